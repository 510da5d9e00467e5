"use strict";
// the values below the pointer, or below a cursor that the arrow keys move
for (const chart of document.querySelectorAll(".chart")) {
  const data = JSON.parse(chart.querySelector("script").textContent);
  const readout = chart.querySelector(".readout");
  const last = data.x.length - 1;
  let at = 0;
  const show = (index) => {
    at = Math.min(Math.max(index, 0), last);
    const values = data.names.map((name, k) => `${name}: ${data.rows[k][at] ?? "-"}`);
    readout.textContent = [`${data.label}: ${data.x[at]}`, ...values].join("   ");
    for (const svg of chart.querySelectorAll("svg[data-from]")) {
      const from = Number(svg.dataset.from), to = Number(svg.dataset.to), cursor = svg.querySelector(".cursor");
      const x = from + (to - from) * (data.x[at] - data.x[0]) / (data.x[last] - data.x[0] || 1);
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
      cursor.style.visibility = "visible";
    }
  };
  const nearest = (x) => {
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (data.x[middle] < x) low = middle; else high = middle;
    }
    return x - data.x[low] < data.x[high] - x ? low : high;
  };
  for (const svg of chart.querySelectorAll("svg[data-from]"))
    svg.addEventListener("pointermove", (event) => {
      const box = svg.getBoundingClientRect(), units = svg.viewBox.baseVal.width / box.width;
      const from = Number(svg.dataset.from), to = Number(svg.dataset.to);
      const share = ((event.clientX - box.left) * units - from) / (to - from);
      show(nearest(data.x[0] + share * (data.x[last] - data.x[0])));
    });
  chart.querySelector("[tabindex]").addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, PageUp: -25, PageDown: 25, Home: -last, End: last }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    show(at + step);
  });
}
// paper cannot be unfolded
const folded = () => document.querySelectorAll("details:not([open])");
addEventListener("beforeprint", () => folded().forEach((details) => { details.open = true; details.dataset.printed = "1"; }));
addEventListener("afterprint", () => document.querySelectorAll("details[data-printed]").forEach((details) => {
  details.open = false;
  delete details.dataset.printed;
}));
