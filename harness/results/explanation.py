"""What a person needs to go on from a record that is not as expected, as plain text."""

from __future__ import annotations

import math

from harness.results.records import Record


def explain(record: Record) -> str:
    """Verdict, message, state and replay command, a line each."""
    lines = [f"{record.system} {record.subject}: {record.verdict}, expected {record.expected}"]
    if record.backward_error is not None:
        lines.append(f"  worst backward error {record.backward_error:.3g} data roundoffs over {record.states:,} states; up to 64 agrees")
    if record.expected_reason:
        limit = f", up to {record.expected_backward_error:g}," if math.isfinite(record.expected_backward_error) else ""
        lines.append(f"  expected{limit} because {record.expected_reason} ({record.expected_link})")
        lines.append("  remove or mend the entry in expected_verdicts.toml if that is past")
    if record.message:
        lines.append(f"  {record.message}")
    if record.worst_state is not None:
        lines.append("  at " + ", ".join(f"{name} = {values}" for name, values in record.worst_state.items()))
    if record.replay:
        lines.append(f"  replay: {record.replay}")
    return "\n".join(lines)
