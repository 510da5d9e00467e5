"""A chart to put into pages."""

import numpy as np

from acqd.report.lines import Chart, Line, Panel


def chart(rows=50):
    """Two panels; one value is unknown."""
    t = np.arange(rows) * 0.04
    measured = 200 + 10 * np.sin(t)
    measured[3] = np.nan
    panels = [
        Panel("P [W]", [Line("measured", measured), Line("</script><b>", measured + 1, "after")]),
        Panel("residual [W]", [Line("before", np.sin(5 * t), "before")], 100, zero=True),
    ]
    return Chart(t, "time [s]", panels, "Power over two seconds")
