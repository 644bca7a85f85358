"""A run's report: one folder that can be moved or served as it is.

report.md and report.json for other programs and for pasting, report.html with the tables, the
figure, every trial and its video. Text from outside (instructions, messages of servers) is escaped.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robospa.results import tables
from robospa.results.figure import draw
from robospa.results.metrics import METRIC_NAMES, METRICS, Scores, score_run
from robospa.results.reading import Run, finished
from robospa.results.records import TrialKey, TrialRecord

SHOWN_TRIALS = 2000
"""More trials than this make a page that browsers choke on: failures go first, the rest is cut."""
FILMS = "videos"
END_NAMES = {
    "success": "success",
    "step_limit": "step limit",
    "policy_error": "policy error",
    "goal_lost": "goal lost",
    "infrastructure": "missing",
}


def write_report(run: Run, folder: Path) -> Path:
    """Write the report of `run` into `folder` and return it."""
    folder.mkdir(parents=True, exist_ok=True)
    scores = score_run(run)
    known = [r for r in run.records.values() if finished(r)]
    figures = draw(scores, known, folder)
    data = {"run": about(run), **tables.to_json(scores), "ends": ends(run)}
    (folder / "report.json").write_text(json.dumps(data, indent=1) + "\n")
    (folder / "report.md").write_text(markdown(run, scores))
    (folder / "report.html").write_text(html(run, scores, folder, figures))
    return folder


def about(run: Run) -> dict[str, Any]:
    """What was evaluated, with what, where: the facts of the manifest that a reader needs."""
    manifest = run.manifest
    settings = manifest.get("settings", {})
    machine = manifest.get("about", {})
    spec = settings.get("policy", {}).get("spec", {})
    return {
        "policy": spec.get("name", "unknown"),
        "privileged": tables.is_privileged(run),
        "seeded": bool(spec.get("seeded")),
        "spec": spec,
        "trials": len(run.keys),
        "results": len(run.keys) - len(run.missing),
        "missing": len(run.missing),
        "settings": settings,
        "seed_hash": manifest.get("seed_hash", ""),
        "versions": machine.get("versions", {}),
        "git": machine.get("git", {}),
        "machine": machine.get("machine", {}),
        "world": machine.get("world", {}),
    }


def ends(run: Run) -> dict[str, int]:
    """How many trials ended in which way; trials that were never run count as "not run"."""
    counts: dict[str, int] = {}
    for key in run.keys:
        record = run.records.get(key)
        name = "not run" if record is None else END_NAMES[record.end]
        counts[name] = counts.get(name, 0) + 1
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def latency(run: Run) -> dict[str, float]:
    """Milliseconds that the policy took to answer: median and largest of the trials' p50, p99."""
    found = [r.latency for r in run.records.values() if r.latency]
    if not found:
        return {}
    middle = sorted(x["p50"] for x in found)[len(found) // 2]
    return {"p50": middle, "p99": max(x["p99"] for x in found), "max": max(x["max"] for x in found)}


def timing(run: Run) -> dict[str, float]:
    """Share of the trials' wall time by purpose."""
    total = sum(r.wall_time for r in run.records.values())
    sums: dict[str, float] = {}
    for record in run.records.values():
        for name, seconds in record.timing.items():
            sums[name] = sums.get(name, 0.0) + seconds
    return (
        {name: s / total for name, s in sorted(sums.items(), key=lambda p: -p[1])} if total else {}
    )


def facts(run: Run) -> list[tuple[str, str]]:
    """The report's head, as name and text."""
    info = about(run)
    git = info["git"]
    commit = (
        f", commit {git['commit'][:12]}{' + changes' if git.get('dirty') else ''}" if git else ""
    )
    spent = latency(run)
    world = info["world"]
    found = [
        ("policy", info["policy"] + (", privileged: sees the exact state" * info["privileged"])),
        ("trials", f"{info['results']} of {info['trials']} with a result"),
        ("ends", ", ".join(f"{count} {name}" for name, count in ends(run).items())),
        ("list of trials", f"hash {info['seed_hash']}"),
        ("software", f"robospa {info['versions'].get('robospa', '?')}{commit}"),
        ("world", ", ".join(f"{k} {_line(v)}" for k, v in world.items() if v is not None)),
    ]
    if spent:
        text = (
            f"median {spent['p50']:.1f} ms, p99 {spent['p99']:.1f} ms, most {spent['max']:.1f} ms"
        )
        found.append(("policy latency", text))
    if timing(run):
        parts = [f"{name} {100 * x:.0f} %" for name, x in timing(run).items() if x >= 0.005]
        found.append(("time spent on", ", ".join(parts)))
    return found


def markdown(run: Run, scores: Scores) -> str:
    """The report as Markdown."""
    lines = [f"# {about(run)['policy']}", ""]
    lines += [f"* {name}: {text}" for name, text in facts(run)]
    for line in tables.missing_lines(scores):
        lines.append(f"* **missing**: {line}")
    for metric in shown_metrics(scores):
        lines += ["", f"## {METRIC_NAMES[metric]}", "", tables.markdown_table(scores, metric)]
    lines += ["", tables.NOTE, ""]
    return "\n".join(lines)


def shown_metrics(scores: Scores) -> list[str]:
    """The metrics that any variant of the run has."""
    present = {m for cell in scores.cells.values() for m in cell.values}
    return [m for m in METRICS if m in present]


def html(run: Run, scores: Scores, folder: Path, figures: list[str]) -> str:
    """The report as one page; videos are linked into `folder`."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("robospa.results", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    trials = [trial_row(run, key, folder) for key in trial_order(run)[:SHOWN_TRIALS]]
    return environment.get_template("report.html").render(
        title=about(run)["policy"],
        privileged=tables.is_privileged(run),
        facts=facts(run),
        missing=tables.missing_lines(scores),
        metrics=[(m, METRIC_NAMES[m], table_rows(scores, m)) for m in shown_metrics(scores)],
        levels=[tables.level_name(n) for n in (*scores.levels, 0)],
        note=tables.NOTE,
        figures=figures,
        trials=trials,
        films=[t for t in trials if t["video"]],
        left_out=max(0, len(run.keys) - SHOWN_TRIALS),
        ends=sorted({t["end"] for t in trials}),
    )


def table_rows(scores: Scores, metric: str) -> list[dict[str, Any]]:
    """One table for the page."""
    made = []
    for row in tables.rows(scores):
        if metric in tables.metrics_of(row):
            cells = [_page_cell(part, metric) for _, part in row.parts]
            made.append({"label": row.label, "kind": row.kind, "cells": cells})
    return made


def _page_cell(part: Any, metric: str) -> dict[str, Any]:
    if part is None:
        return {"value": "", "interval": "", "shade": 0, "missing": "", "count": ""}
    estimate = part.values.get(metric)
    text = tables.percent(estimate)
    value, _, interval = text.partition(" ")
    lost = f"{part.missing} missing: SR {100 * part.worst:.0f} to {100 * part.best:.0f}"
    successes = getattr(part, "successes", None)
    return {
        "value": value,
        "interval": interval,
        "shade": 0 if estimate is None else round(0.3 * max(0.0, min(1.0, estimate.value)), 3),
        "missing": lost if part.missing else "",
        "count": f"{successes} of {part.trials}"
        if successes is not None
        else f"{part.trials} trials",
    }


def trial_order(run: Run) -> list[TrialKey]:
    """All trials in the run's order; if they are too many for a page, failures first."""
    if len(run.keys) <= SHOWN_TRIALS:
        return list(run.keys)

    def good(key: TrialKey) -> bool:
        record = run.records.get(key)
        return record is not None and record.success

    return sorted(run.keys, key=good)


def trial_row(run: Run, key: TrialKey, folder: Path) -> dict[str, Any]:
    """One line of the page's list of trials."""
    record = run.records.get(key)
    row: dict[str, Any] = {"task": key.task.replace("_", " "), "level": key.level, "seed": key.seed}
    if record is None:
        return {**row, **_NOT_RUN}
    return {
        **row,
        "instruction": record.instruction,
        "end": END_NAMES[record.end],
        "good": record.success,
        "progress": f"{record.done}/{record.total}",
        "steps": record.steps,
        "seconds": f"{record.wall_time:.1f}",
        "message": record.message,
        "events": [event_text(e) for e in record.events],
        "digest": record.digest[:16],
        "video": film(run, record, folder),
    }


_NOT_RUN: dict[str, Any] = {
    "instruction": "",
    "end": "not run",
    "good": False,
    "progress": "",
    "steps": "",
    "seconds": "",
    "message": "",
    "events": [],
    "digest": "",
    "video": "",
}


def event_text(event: Mapping[str, Any]) -> str:
    """One event in a few words."""
    parts = [f"{float(event.get('time', 0.0)):.2f} s", str(event.get("kind", "")).replace("_", " ")]
    if int(event.get("index", -1)) >= 0:
        parts.append(f"#{int(event['index']) + 1}")
    parts += [str(event[name]) for name in ("object", "note") if event.get(name)]
    return " ".join(parts)


def film(run: Run, record: TrialRecord, folder: Path) -> str:
    """Put the trial's video into `folder` and return its relative path ("" if there is none)."""
    source = (run.folder / record.video).resolve()
    inside = source.is_relative_to(run.folder.resolve())
    if not record.video or not inside or not source.is_file():
        return ""
    target = folder / FILMS / source.name
    target.parent.mkdir(exist_ok=True)
    if not target.exists():
        try:
            os.link(source, target)
        except OSError:
            shutil.copyfile(source, target)
    return f"{FILMS}/{source.name}"


def _line(value: object) -> str:
    """`value` as text without line breaks; of a mapping, its values."""
    if isinstance(value, Mapping):
        return " ".join(dict.fromkeys(_line(v) for v in value.values() if v is not None))
    return " ".join(str(value).split())
