"use strict";
{
  const SIZE = 300, MIDDLE = SIZE / 2, LONGEST = 0.8 * MIDDLE, known = new Map();
  const svg = (name, attributes, text = "") => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    node.textContent = text;
    return node;
  };
  const at = (length, degrees) => [MIDDLE + length * Math.cos(degrees * Math.PI / 180), MIDDLE - length * Math.sin(degrees * Math.PI / 180)];

  function arrows(values, letter, share) {
    const largest = Math.max(...values.map(([size]) => size)) || 1;
    return values.flatMap(([size, degrees], k) => {
      const [x, y] = at(share * LONGEST * size / largest, degrees), [tx, ty] = at(share * LONGEST * size / largest + 14, degrees);
      const line = svg("line", { x1: MIDDLE, y1: MIDDLE, x2: x, y2: y, class: letter, style: `stroke: var(--L${k + 1})` });
      return [line, svg("text", { x: tx, y: ty, "text-anchor": "middle", "dominant-baseline": "middle" }, `${letter}${k + 1}`)];
    });
  }

  function draw() {
    const wiring = known.get(view.device);
    $("wiring-section").hidden = !wiring;
    if (!wiring) return;
    const { U, I } = wiring.phasors, picture = $("phasors").querySelector("svg");
    picture.replaceChildren(svg("circle", { cx: MIDDLE, cy: MIDDLE, r: LONGEST }), ...arrows(U, "U", 1), ...arrows(I, "I", 0.6));
    picture.setAttribute("aria-label", [...U.map(([size, angle], k) => `U${k + 1} ${size.toFixed(1)} V at ${angle}°`), ...I.map(([size, angle], k) => `I${k + 1} ${size.toFixed(2)} A at ${angle}°`)].join(", "));
    const body = $("phasor-table").tBodies[0];
    body.replaceChildren(...U.map(([volts, angle], k) => {
      const row = document.createElement("tr"), [amperes, other] = I[k], lag = ((angle - other + 540) % 360) - 180;
      cells(row, [`L${k + 1}`, volts.toFixed(1), angle.toFixed(1), amperes.toFixed(3), other.toFixed(1), lag.toFixed(1)]);
      return row;
    }));
    const findings = wiring.findings.map(({ text, correction }) => {
      const item = Object.assign(document.createElement("li"), { textContent: text });
      if (correction) item.append(": ", Object.assign(document.createElement("code"), { textContent: correction }));
      return item;
    });
    $("wiring-findings").replaceChildren(...findings);
    $("wiring-findings").hidden = !findings.length;
  }

  events.addEventListener("wiring", (event) => {
    const { device, wiring } = JSON.parse(event.data);
    known.set(device, wiring);
    draw();
  });
  onDevice.push(draw);
}
