"""The benchmark's categories of tasks and what is measured in them."""

from __future__ import annotations

SPATIAL = ("GAC", "SDE", "CPI", "RRR", "CVR")
PROCEDURAL = ("RPF", "OFE", "OCE", "CAC", "MIP")
CATEGORIES = SPATIAL + PROCEDURAL
BASIC = ("CBG", "EPG", "SOI")
"""The appendix's references: scored by category, part of no dimension, not of the overall value."""
CATEGORY_NAMES = {
    "GAC": "Geometric Attribute Cognition",
    "SDE": "Spatial Distance Estimation",
    "CPI": "Canonical Position Indexing",
    "RRR": "Referential Relational Reasoning",
    "CVR": "Cross-View Reasoning",
    "RPF": "Repetitive Procedure Following",
    "OFE": "Order-Free Execution",
    "OCE": "Order-Constrained Execution",
    "CAC": "Composite Action Coordination",
    "MIP": "Memory-Intensive Planning",
    "CBG": "Color-Based Grounding",
    "EPG": "Egocentric Position Grounding",
    "SOI": "Simple Ordinal Indexing",
}
DIMENSIONS = {"spatial": SPATIAL, "procedural": PROCEDURAL}
METRICS = ("sr", "onta", "ps")
"""Success rate, object-normalized target accuracy, progress score."""
METRIC_NAMES = {"sr": "SR", "onta": "ONTA", "ps": "PS"}
METRIC_CATEGORIES = {"sr": CATEGORIES, "onta": SPATIAL, "ps": PROCEDURAL}
"""The categories that a metric is averaged over."""
