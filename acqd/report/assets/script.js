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
    readout.textContent = [`${data.label}: ${data.x[at]}`, ...values].join("   ").replace(/(\d) (?=[A-Za-zµ%°])/g, "$1\u00a0");
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
// tables that a reader sorts by a column and filters by a word
for (const table of document.querySelectorAll("table[data-sortable]")) {
  const body = table.tBodies[0], rows = [...body.rows], heads = [...table.tHead.rows[0].cells];
  const value = (row, k) => {
    const words = row.cells[k].textContent.trim(), number = Number.parseFloat(words.replace(/^[<>=\s]+/, ""));
    return /^[<>=\s]*[-+]?\d/.test(words) && !/^\d{4}-\d\d/.test(words) ? number : words.toLowerCase();
  };
  heads.forEach((head, k) => {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: head.textContent });
    head.replaceChildren(button);
    button.onclick = () => {
      const falling = head.ariaSort === "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", falling ? "descending" : "ascending");
      const order = rows.map((row) => [value(row, k), row]).sort(([a], [b]) => {
        const empty = (v) => v === "" || v === "-";
        if (empty(a) || empty(b)) return empty(a) - empty(b);
        const way = typeof a === typeof b ? (a < b ? -1 : a > b) : typeof a === "number" ? -1 : 1;
        return falling ? -way : way;
      });
      body.append(...order.map(([, row]) => row));
    };
  });
  const label = Object.assign(document.createElement("label"), { className: "filter", textContent: "Show rows with " });
  const input = label.appendChild(Object.assign(document.createElement("input"), { type: "search" }));
  const said = (number) => ` ${number} row${number === 1 ? "" : "s"}`;
  const count = label.appendChild(Object.assign(document.createElement("output"), { textContent: said(rows.length) }));
  input.oninput = () => {
    const word = input.value.trim().toLowerCase();
    // a number and its unit have a no-break space in the page, and none on a keyboard
    rows.forEach((row) => { row.hidden = !row.textContent.replaceAll("\u00a0", " ").toLowerCase().includes(word); });
    count.textContent = said(rows.filter((row) => !row.hidden).length);
  };
  table.parentNode.before(label);
}
// paper cannot be unfolded
const folded = () => document.querySelectorAll("details:not([open])");
addEventListener("beforeprint", () => folded().forEach((details) => { details.open = true; details.dataset.printed = "1"; }));
addEventListener("afterprint", () => document.querySelectorAll("details[data-printed]").forEach((details) => {
  details.open = false;
  delete details.dataset.printed;
}));
