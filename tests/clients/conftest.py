"""The fake torch, for the tests of model servers."""

from model_fakes import torch

__all__ = ["torch"]
