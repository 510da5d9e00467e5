"use strict";
// the arm as it moves now: two minutes of postures, each with the measured and predicted power of its time
const armLive = (() => {
  const KEPT_S = 120, NEAR_S = 0.15, LATE_S = 2, BACK_S = 2, RARELY_MS = 180;
  const of = {}; // device -> { postures, rows, predicted }, oldest first
  const kept = (device) => of[device] ??= { postures: [], rows: [], predicted: [] };
  let view3d = null, colours = {}, robot = "", drawn = 0;

  function keep(list, entry) {
    if (list.length && entry.time < list.at(-1).time - BACK_S) { // the sender's clock was set back
      list.length = 0;
      kept.first = null;
    }
    if (list.length && entry.time <= list.at(-1).time) return; // older rows that arrive late
    list.push(entry);
    while (list[0].time < entry.time - KEPT_S) list.shift();
  }
  function nearest(list) {
    let k = 0;
    return (time) => {
      while (k < list.length - 1 && Math.abs(list[k + 1].time - time) <= Math.abs(list[k].time - time)) k++;
      return list[k] && Math.abs(list[k].time - time) < NEAR_S ? list[k] : null;
    };
  }

  function motionOf({ postures: all, rows, predicted }) {
    const said = predicted.at(-1)?.time ?? -Infinity; // predictions come a few rows later
    const postures = all.at(-1).time - said < LATE_S ? all.filter(({ time }) => time <= said + NEAR_S) : all;
    const first = kept.first ??= all[0].time, row = nearest(rows), split = nearest(predicted);
    const known = predicted.findLast(({ causes }) => causes)?.causes, names = known ? Object.keys(known) : predicted.length ? ["predicted"] : [];
    const rowsOf = postures.map(({ time }) => row(time)?.P ?? NaN), says = postures.map(({ time }) => split(time));
    const power = (said, name) => said ? known ? said.causes?.[name] ?? 0 : said.P : NaN;
    const layers = names.map((name) => ({ name, colour: colours[name] ?? "#5b7083", W: says.map((said) => power(said, name)) }));
    const residual = says.map((said, k) => said && Number.isFinite(rowsOf[k]) ? rowsOf[k] - said.P : NaN);
    const leading = known && { layer: says.map((said) => (said?.joints ?? []).map(([name]) => Math.max(0, names.indexOf(name)))), W: says.map((said) => (said?.joints ?? []).map(([, W]) => W)) };
    return {
      name: "now", t: postures.map(({ time }) => time - first), q: postures.map(({ q }) => q), measured: rowsOf, predicted: layers,
      residual: names.length ? [{ name: "residual", colour: "#c0392b", W: residual }] : [], joints: leading ? { predicted: leading } : null,
    };
  }

  function draw(device) {
    const mine = of[device];
    $("arm-section").hidden = !mine?.postures.length;
    if ($("arm-section").hidden || !view3d || view3d.playing || document.visibilityState !== "visible" || performance.now() - drawn < RARELY_MS) return;
    drawn = performance.now();
    view3d.follow(motionOf(mine));
    put($("posture-note"), `${robot}: the flange is ${view3d.flangeAt.map((x) => x.toFixed(2)).join(", ")} m from the base (x, y, z).`);
  }

  events.addEventListener("rows", (event) => {
    for (const row of JSON.parse(event.data)) if (row.channel === "total" || row.channel === "L1" && !newest[row.device]?.total) keep(kept(row.device).rows, { time: unixOf(row), P: row.P });
  });
  events.addEventListener("prediction", (event) => {
    const said = JSON.parse(event.data), list = kept(said.device).predicted;
    if (said.causes || !list.at(-1)?.causes) keep(list, said);
  });
  onDevice.push(() => { drawn = 0; draw(view.device); });
  return {
    async begin(script) {
      const arm = await (await fetch("/api/arm")).json();
      colours = arm.colours;
      robot = arm.robot;
      $("arm-section").hidden = false;
      view3d = new acqdArm.View($("posture"), arm.frames, () => script("three.min.js").then(() => THREE));
    },
    take(posture) {
      keep(kept(posture.device).postures, posture);
      if (!view.device || posture.device === view.device) draw(posture.device);
    },
  };
})();
