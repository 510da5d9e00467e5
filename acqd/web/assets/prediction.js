"use strict";
{
  const LOOK_MS = 15000, AGAIN_MS = 2000, ROWS = 12;
  const shown = { logs: [], chosen: "", course: null, power: null, residual: null, alarms: {}, postures: {} };
  const when = (unix) => new Date(1000 * unix).toISOString().slice(0, 19).replace("T", " ");

  function alarm(of) {
    $("alarm").hidden = !of;
    if (of) put($("alarm"), `The residual has changed since ${when(of.onset_s)} UTC (${of.chart}${of.log ? `, seen in ${of.log}` : ""}).`);
    if (of) $("model-section").hidden = false;
  }

  function list(logs) {
    const select = $("logs"), body = $("log-table").tBodies[0];
    const usable = logs.filter((log) => log.status === "ok");
    const names = usable.map((log) => log.sha256).join();
    if (select.dataset.names !== names) {
      select.dataset.names = names;
      const newest = !shown.chosen || shown.chosen === shown.logs.find((log) => log.status === "ok")?.sha256;
      select.replaceChildren(...usable.map((log) => new Option(log.name, log.sha256)));
      if (!newest && usable.some((log) => log.sha256 === shown.chosen)) select.value = shown.chosen;
      choose(select.value);
    }
    shown.logs = logs;
    body.replaceChildren();
    for (const log of logs.slice(0, ROWS)) {
      const row = body.insertRow(), Wh = (kWh) => kWh === undefined ? "-" : (1000 * kWh).toFixed(2);
      const drift = log.alarm ? `alarm: ${log.alarm.chart}` : log.status === "refused" ? `refused: ${log.reason}` : log.drift ?? "";
      cells(row, [log.name, (log.begin ?? "").slice(0, 19).replace("T", " "), log.rmse_W === undefined ? "-" : log.rmse_W.toFixed(2), Wh(log.energy_kWh), Wh(log.energy_predicted_kWh), drift]);
      if (log.alarm || log.status === "refused") row.lastChild.className = log.alarm ? "bad" : "open";
    }
  }

  async function choose(sha256) {
    shown.chosen = sha256;
    if (!sha256) return;
    const answer = await fetch(`/api/course?${new URLSearchParams({ sha256 })}`);
    if (!answer.ok || shown.chosen !== sha256) return;
    shown.course = await answer.json();
    draw();
  }

  function draw() {
    const course = shown.course;
    if (!course?.time.length) return;
    const begin = course.time[0], seconds = course.time.map((at) => at - begin);
    const lines = [["measured", colour("total"), []], ["predicted", colour("predicted"), [10, 3, 2, 3]]];
    const plot = (node, height, label, series, rows) => {
      const [x, y] = axes({ label: "time in the log [s]" }, { label });
      return new uPlot({ width: node.clientWidth, height, legend: { show: false }, cursor: { drag: { x: false } }, scales: { x: { time: false } }, axes: [x, y],
        series: [{}, ...series.map(([name, stroke, dash]) => ({ label: name, stroke, dash, width: 1.5, points: { show: false } }))] }, rows, node);
    };
    shown.power?.destroy();
    shown.residual?.destroy();
    shown.power = plot($("predicted-course"), 240, "P [W]", lines, [seconds, course.measured, course.predicted]);
    shown.residual = plot($("residual-course"), 160, "residual [W]", [["residual", colour("L2"), []]], [seconds, course.residual]);
    readable($("predicted-course"), shown.power);
    readable($("residual-course"), shown.residual);
    legend($("course-legend"), [...lines, ["residual = measured - predicted", colour("L2"), []]]);
    const least = Math.min(...course.residual), most = Math.max(...course.residual);
    put($("course-note"), `residual from ${least.toFixed(1)} to ${most.toFixed(1)} W${course.rows_per_point > 1 ? `, means of ${course.rows_per_point} rows` : ""}`);
  }

  // the scripts of the arm are loaded with the first posture, and three.js when the arm comes into sight
  async function arm() {
    try {
      for (const name of ["arm.js", "arm_live.js"]) await script(name);
      await armLive.begin(script);
    } catch {
      setTimeout(arm, AGAIN_MS);
      return;
    }
    style("arm.css");
    shown.arm = armLive;
    Object.values(shown.postures).forEach(armLive.take);
  }

  async function look() {
    try {
      const answer = await fetch("/api/predictions");
      if (!answer.ok) return;
      const { logs, note } = await answer.json();
      if (logs.length) {
        $("model-section").hidden = false;
        list(logs);
      }
      if (note) {
        $("arm-section").hidden = false;
        put($("posture-note"), note);
      }
    } catch { /* asked again soon */ }
  }

  $("logs").onchange = () => choose($("logs").value);
  events.addEventListener("alarm", (event) => {
    const { device, alarm: of } = JSON.parse(event.data);
    shown.alarms[device] = of;
    if (!view.device || device === view.device) alarm(of);
  });
  events.addEventListener("posture", (event) => {
    const posture = JSON.parse(event.data);
    shown.postures[posture.device] = posture;
    shown.loading ??= arm();
    shown.arm?.take(posture);
  });
  onDevice.push(() => alarm(shown.alarms[view.device]));
  addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  setInterval(() => document.visibilityState === "visible" && look(), LOOK_MS);
  look();
}
