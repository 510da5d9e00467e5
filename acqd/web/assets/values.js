"use strict";
// the values below the pointer, or below a cursor that the arrow keys move, said beneath the chart
function acqdValues(node, begun) {
  if (node.said) return;
  node.said = Object.assign(document.createElement("output"), { className: "note" });
  node.after(node.said);
  const shown = node.shown ?? ((x) => Number(x.toPrecision(6)));
  const say = (k) => {
    const { axes: [axis], data: [x, ...rows], series } = node.plot;
    const values = rows.map((row, n) => `${series[n + 1].label} ${row[k] == null ? "-" : Number(row[k].toPrecision(5))}`);
    put(node.said, k == null ? "" : `${axis.label} ${shown(x[k])}: ${values.join(", ")}`);
  };
  node.onpointermove = () => requestAnimationFrame(() => say(node.plot.cursor.idx));
  node.onpointerleave = () => say(null);
  node.onkeydown = (event) => {
    const u = node.plot, [first, last] = u.series[0].idxs ?? [0, -1];
    const step = { ArrowLeft: -1, ArrowRight: 1, PageUp: -25, PageDown: 25, Home: -Infinity, End: Infinity }[event.key];
    if (step === undefined || last < first) return;
    event.preventDefault();
    const k = Math.min(Math.max((u.cursor.idx ?? last) + step, first), last);
    u.setCursor({ left: u.valToPos(u.data[0][k], "x"), top: 1 });
    say(k);
  };
  if (begun.type === "keydown") node.onkeydown(begun);
}
