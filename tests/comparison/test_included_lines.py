"""What stands in an included file is named with that file."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import harness

OUTER = '<mujoco>\n  <include file="inner.xml"/>\n</mujoco>\n'
INNER = """<mujoco>
  <worldbody>
    <body name="bar">
      <joint name="pin" axis="0 1 0"/>
      <inertial pos="0 0 -0.5" mass="1" diaginertia="0.1 0.1 0.5"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("options", [(), ("--verbose",)])
def test_an_inertia_in_an_included_file_has_the_line_of_that_file(tmp_path: Path, options: tuple[str, ...]) -> None:
    (tmp_path / "inner.xml").write_text(INNER)
    (tmp_path / "outer.xml").write_text(OUTER)
    done = harness("compare", "outer.xml", *options, "--states", "4", cwd=tmp_path)
    assert "inner.xml:5" in done.stdout and "outer.xml:5" not in done.stdout and "line 5" not in done.stdout
