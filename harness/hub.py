"""Runs and data sets on the Hugging Face hub, through its own client."""

from __future__ import annotations

from pathlib import Path

from robospa.extras import need
from robospa.harness.datasets.manifest import MANIFEST
from robospa.harness.running.atomic_file import PARTIAL
from robospa.results.records.manifest import RunError
from robospa.results.records.run_io import read_run
from robospa.results.records.run_state import LOCK
from robospa.results.report.run_view import run_table
from robospa.results.tables import to_markdown

RUN = "run.json"
IGNORED = (LOCK, PARTIAL, "logs/*", "wandb/*", "wandb.txt", "episodes/*")
"""What of a folder is of use to nobody else."""
PAGE = """---
tags: [robotics, robospa]
---

# {name}

{table}

`robospa report` and `robospa compare` read this folder once it is downloaded.
"""


def upload(
    folder: Path, repository: str, *, private: bool = False, token: str | None = None
) -> str:
    """Upload the run or the data set in `folder` to the data set `repository`, OWNER/NAME, which is
    made if there is none; the address.

    Raises RunError if it is neither, or a run that is still going on; MissingPackage without
    huggingface_hub; and what the hub's client raises.
    """
    is_run, is_set = (folder / RUN).is_file(), (folder / MANIFEST).is_file()
    if not (is_run or is_set):
        raise RunError(f"{folder} holds neither a run ({RUN}) nor a finished data set ({MANIFEST})")
    page = _page(folder) if is_run else None
    api = need("huggingface_hub").HfApi(token=token)
    api.create_repo(repository, repo_type="dataset", private=private, exist_ok=True)
    name = folder.resolve().name
    inside = name if is_run else "."
    api.upload_folder(
        repo_id=repository,
        repo_type="dataset",
        folder_path=str(folder),
        path_in_repo=inside,
        ignore_patterns=list(IGNORED),
        commit_message=f"{'run' if is_run else 'data set'} {name}",
    )
    if page is not None:
        api.upload_file(
            path_or_fileobj=page.encode(),
            path_in_repo=f"{inside}/README.md",
            repo_id=repository,
            repo_type="dataset",
            commit_message=f"table of {name}",
        )
    address = f"https://huggingface.co/datasets/{repository}"
    return f"{address}/tree/main/{name}" if is_run else address


def _page(folder: Path) -> str:
    """The page of a run: its table."""
    run = read_run(folder)
    if run.in_progress:
        raise RunError(f"{folder} is still going on: push it when it has ended")
    return PAGE.format(name=folder.resolve().name, table=to_markdown(run_table(run)))
