"use strict";
{
  const LOOK_MS = 1000, LATER_MS = 10000, HEIGHT = 260;
  const scope = { phase: 1, held: false, picture: null, wave: null, bars: null, busy: false, notBefore: 0, at: null };
  const section = $("scope").parentElement;
  visibility.observe(section);

  const channels = () => [`U${scope.phase}`, `I${scope.phase}`];
  const unit = (name) => name[0] === "U" ? "V" : "A";
  const width = (node) => node.clientWidth;

  function phases(picture) {
    const count = Object.keys(picture.traces).length / 2, box = $("scope-phases");
    if (scope.phase > count) scope.phase = 1;
    if (box.querySelectorAll("button").length === count) return;
    box.querySelectorAll("button").forEach((button) => button.remove());
    for (let phase = 1; phase <= count; phase++) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: `L${phase}` });
      button.setAttribute("aria-pressed", phase === scope.phase);
      button.onclick = () => {
        scope.phase = phase;
        box.querySelectorAll("button").forEach((other) => other.setAttribute("aria-pressed", other === button));
        draw(true);
      };
      box.append(button);
    }
  }

  function draw(anew) {
    const picture = scope.picture;
    if (!picture) return;
    const [u, i] = channels(), lines = [["voltage", colour("L1"), []], ["current", colour("L2"), [8, 4]]];
    const rows = [picture.ms, picture.traces[u], picture.traces[i]];
    if (anew || !scope.wave) {
      scope.wave?.destroy();
      const [x, y] = axes({ label: "time [ms]" }, { label: `${u} [V]`, scale: "V" });
      scope.wave = new uPlot({
        width: width($("wave")), height: HEIGHT, legend: { show: false }, cursor: { drag: { x: false } }, scales: { x: { time: false } },
        axes: [x, y, { ...y, label: `${i} [A]`, scale: "A", side: 1, grid: { show: false } }],
        series: [{}, ...lines.map(([label, stroke, dash], k) => ({ label, stroke, dash, width: 2, scale: k ? "A" : "V", points: { show: false } }))],
      }, rows, $("wave"));
      readable($("wave"), scope.wave);
      legend($("scope-legend"), lines);
    } else scope.wave.setData(rows);
    spectrum(anew);
    table();
    const at = new Date(1000 * unixOf(picture)), from = picture.archived
      ? `archive, from ${at.toISOString().replace("T", " ").slice(0, 23)} UTC${picture.broken ? " (samples are missing in this second)" : ""}; figures of 0.2 s`
      : `window ${picture.seq} at ${at.toLocaleTimeString("sv-SE")}`;
    put($("scope-note"), `${from}${picture.f ? `, ${picture.f.toFixed(3)} Hz` : ", no mains"}${picture.flags.length ? `; flags: ${picture.flags.join(", ")}` : ""}`);
  }

  function spectrum(anew) {
    const [u, i] = channels().map((name) => scope.picture.figures[name].percent);
    $("spectrum").hidden = !u.length && !i.length;
    if ($("spectrum").hidden) return;
    const count = Math.max(u.length, i.length), orders = Array.from({ length: count }, (_, k) => k + 2);
    const rows = [orders, u.length ? u : Array(count).fill(null), i.length ? i : Array(count).fill(null)];
    if (anew || !scope.bars) {
      scope.bars?.destroy();
      const names = [["voltage", colour("L1")], ["current", colour("L2")]];
      scope.bars = new uPlot({
        width: width($("harmonics")), height: 220, legend: { show: false }, cursor: { drag: { x: false } },
        scales: { x: { time: false, range: [1, 41] }, y: { range: (_, low, high) => [0, Math.max(high * 1.05, 1)] } },
        axes: axes({ label: "order", incrs: [1, 2, 5, 10], space: 30 }, { label: "% of the fundamental" }),
        series: [{}, ...names.map(([label, stroke], k) => ({ label, stroke, fill: k ? "transparent" : stroke, width: 2, paths: uPlot.paths.bars({ size: [0.36], align: k ? 1 : -1 }), points: { show: false } }))],
      }, rows, $("harmonics"));
      readable($("harmonics"), scope.bars);
      legend($("harmonic-legend"), [[`voltage (filled)`, names[0][1]], [`current (outlined)`, names[1][1], [1, 0]]]);
    } else scope.bars.setData(rows);
  }

  function table() {
    const figures = scope.picture.figures, names = Object.keys(figures);
    names.forEach((name, k) => {
      const one = figures[name], digits = unit(name) === "V" ? 1 : 3;
      const row = $("wave-figures").tBodies[0].rows[k] ?? $("wave-figures").tBodies[0].insertRow();
      const value = (x) => x === null ? "-" : `${x.toFixed(digits)} ${unit(name)}`;
      const share = (order) => text(one.percent[order - 2], 2);
      cells(row, [name, value(one.rms), value(one.peak), value(one.fundamental), text(one.thd, 2), share(3), share(5), share(7)]);
    });
    if (!$("all-harmonics").closest("details").open) return;
    const head = $("all-harmonics").tHead.rows[0] ?? $("all-harmonics").tHead.insertRow();
    ["order", ...names.map((name) => `${name} [%]`)].forEach((label, k) => put(head.cells[k] ?? head.appendChild(Object.assign(document.createElement("th"), { scope: "col" })), label));
    for (let order = 2; order <= 40; order++) {
      const row = $("all-harmonics").tBodies[0].rows[order - 2] ?? $("all-harmonics").tBodies[0].insertRow();
      cells(row, [String(order), ...names.map((name) => text(figures[name].percent[order - 2], 2))]);
    }
  }

  async function look() {
    if (scope.held || scope.at !== null || scope.busy || !view.device || !inSight(section) || performance.now() < scope.notBefore) return;
    scope.busy = true;
    try {
      const answer = await fetch(`/api/window?${new URLSearchParams({ device: view.device })}`);
      const picture = await answer.json();
      if (!picture.traces) {
        put($("scope-note"), picture.note ?? picture.error);
        scope.notBefore = performance.now() + LATER_MS;
      } else if (picture.device === view.device) {
        const first = !scope.picture;
        scope.picture = picture;
        phases(picture);
        draw(first);
      }
    } catch { /* the state at the top says that the page is not connected */ }
    scope.busy = false;
  }

  async function lookBack(at) {
    if (!view.device || !Number.isFinite(at)) return;
    scope.at = at;
    $("scope-at").value = new Date(1000 * at).toISOString().slice(0, 19);
    try {
      const answer = await fetch(`/api/window?${new URLSearchParams({ device: view.device, at })}`);
      const picture = await answer.json();
      if (scope.at !== at) return; // somebody has asked for another second meanwhile
      if (!picture.traces) {
        put($("scope-note"), picture.note ?? picture.error);
        return;
      }
      scope.picture = picture;
      phases(picture);
      draw(true);
    } catch { /* the state at the top says that the page is not connected */ }
  }

  const asked = () => Date.parse(`${$("scope-at").value}Z`) / 1000;
  const here = () => scope.at ?? Math.floor(scope.picture ? unixOf(scope.picture) : Date.now() / 1000);
  $("scope-at").onchange = () => lookBack(asked());
  $("scope-back").onclick = () => lookBack(here() - 1);
  $("scope-forth").onclick = () => lookBack(here() + 1);
  $("scope-live").onclick = () => {
    scope.at = null;
    $("scope-at").value = "";
    scope.wave?.destroy();
    scope.wave = null;
    look();
  };

  $("hold").onclick = () => {
    scope.held = !scope.held;
    $("hold").setAttribute("aria-pressed", scope.held);
    look();
  };
  $("all-harmonics").closest("details").ontoggle = () => scope.picture && table();
  onDevice.push(() => {
    scope.picture = scope.at = null;
    scope.notBefore = 0;
    scope.wave?.destroy();
    scope.bars?.destroy();
    scope.wave = scope.bars = null;
    $("spectrum").hidden = true;
    $("scope-phases").querySelectorAll("button").forEach((button) => button.remove());
    $("wave-figures").tBodies[0].replaceChildren();
    look();
  });
  addEventListener("resize", () => draw(true));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw(true));
  setInterval(look, LOOK_MS);
}
