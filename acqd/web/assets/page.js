"use strict";
const $ = (id) => document.getElementById(id);
const RANGES = [["1 min", 60], ["10 min", 600], ["1 h", 3600], ["6 h", 21600], ["24 h", 86400], ["7 d", 604800], ["30 d", 2592000]];
const DIGITS = { P: 1, Vrms: 1, Irms: 3, S: 1, PF: 3, f: 3, W: 4 };
const DASH = { L1: [], L2: [8, 4], L3: [2, 3], total: [], predicted: [10, 3, 2, 3] };
const POINTS = 1500, PIXELS = 600, UNIX_OF_FILETIME = 11644473600, QUIET_S = 3, STEADY_MS = 5000;
const view = { device: "", seconds: 60, quantity: "P", end: null };
const newest = {}, heard = {}, wrongs = {};
let latest = {}, series = { time: [], channels: {} }, waiting = [], loading = 0, plot = null, lastRow = 0, broker = true, serverAheadMs = 0, behind = null;
let predicted = [], drawn = 0;
const onDevice = [], visible = new WeakMap();

const scripts = {}; // name -> promise; one that failed is asked for again
const script = (name) => scripts[name] ??= new Promise((done, failed) => document.head.append(Object.assign(document.createElement("script"), { src: `/assets/${name}`, onload: done, onerror: (error) => { delete scripts[name]; failed(error); } })));
const style = (name) => document.head.append(Object.assign(document.createElement("link"), { rel: "stylesheet", href: `/assets/${name}` }));
const text = (value, digits) => value === null || value === undefined ? "-" : value.toFixed(digits);
// no line ends before a unit
const unbroken = (text) => String(text ?? "").replace(/(\d) (?=(?:%|°C|EUR|min|h|[µmkMG]?(?:Wh?|VA?|A|J|Hz|B|m|s))(?!\w))/g, "$1\u00a0");
const put = (node, value) => {
  const text = unbroken(value);
  if ((node.firstChild?.nodeValue ?? "") === text) return false;
  node.textContent = text;
  return true;
};
const visibility = new IntersectionObserver((entries) => entries.forEach((entry) => visible.set(entry.target, entry.isIntersecting)));
const inSight = (node) => visible.get(node) && document.visibilityState === "visible";
const PREFIXED = new Set(["P", "Vrms", "Irms"]);
function large(node, value, digits) {
  node.dataset.unit ??= node.nextSibling.nodeValue.trim();
  const size = Math.abs(value ?? 0), [divisor, prefix] = size < 1e5 ? [1, ""] : size < 1e8 ? [1e3, "k"] : [1e6, "M"];
  put(node, text(value === null ? null : value / divisor, size / divisor < 1e3 ? digits : 1));
  if (node.nextSibling.nodeValue !== ` ${prefix}${node.dataset.unit}`) node.nextSibling.nodeValue = ` ${prefix}${node.dataset.unit}`;
}
const energy = (kWh) => Math.abs(kWh) < 1 ? [kWh * 1000, "Wh"] : Math.abs(kWh) < 1000 ? [kWh, "kWh"] : [kWh / 1000, "MWh"];
const unixOf = (row) => row.filetime / 1e7 - UNIX_OF_FILETIME;
const serverMs = () => Date.now() + serverAheadMs;
const lagMs = (row) => serverMs() - 1000 * unixOf(row);

// rows of one start of a daemon are in the order of their numbers, whatever was done to the clock ("boot.1" follows
// "boot"); those of two starts in the order of time, unless the older one is from the future
function newer(row, before) {
  if (!before) return true;
  const [start, step] = row.boot.split("."), [startBefore, stepBefore] = before.boot.split(".");
  if (start === startBefore) return step === stepBefore ? row.seq >= before.seq : +(step ?? 0) > +(stepBefore ?? 0);
  return row.filetime >= before.filetime || lagMs(before) < -1000 * QUIET_S;
}

function choose(device) {
  view.device = device;
  latest = newest[device] ??= {};
  lastRow = heard[device] ?? 0;
  behind = null;
  predicted = [];
  put($("device"), device);
  load();
  onDevice.forEach((look) => look());
}

function known(device) {
  newest[device] ??= {};
  if (!view.device) choose(device);
}

function onRows(rows) {
  for (const row of rows) {
    known(row.device);
    const of = newest[row.device];
    if (newer(row, of[row.channel])) of[row.channel] = row;
    heard[row.device] = performance.now();
    if (row.device !== view.device) continue;
    if (view.end) { /* the chart stands still */ } else if (loading) waiting.push(row);
    else append(row);
    lastRow = performance.now();
  }
  requestAnimationFrame(numbers);
}

function append(row) {
  const at = unixOf(row), times = series.time, last = times.length - 1;
  const value = row[view.quantity];
  let k = last;
  while (k > 0 && times[k] > at) k--;
  if (last >= 0 && times[k] === at) {
    (series.channels[row.channel] ??= Array(times.length).fill(null))[k] = value;
    return;
  }
  if (last >= 0 && at - times[last] < view.seconds / POINTS) return;
  times.push(at);
  for (const name in series.channels) series.channels[name].push(null);
  (series.channels[row.channel] ??= Array(times.length).fill(null))[times.length - 1] = value;
  let old = 0;
  while (old < times.length && times[old] < at - view.seconds) old++;
  if (old > 100 || old > times.length / 10) {
    times.splice(0, old);
    for (const name in series.channels) series.channels[name].splice(0, old);
  }
}

async function load() {
  if (!view.device) return;
  const mine = ++loading;
  waiting = [];
  const query = new URLSearchParams({ device: view.device, seconds: view.seconds, quantity: view.quantity });
  if (view.end) query.set("end", view.end);
  $("csv").href = `/api/export?${query}`;
  let past = { time: [], channels: {} };
  try {
    const answer = await fetch(`/api/history?${query}`);
    if (answer.ok) past = await answer.json();
    else put($("summary"), (await answer.json()).error);
  } catch { /* the state above says that the page is not connected */ }
  if (mine !== loading) return;
  series = { time: past.time, channels: past.channels, from: past.from };
  const end = series.time.length ? series.time[series.time.length - 1] : 0;
  loading = 0;
  waiting.filter((row) => unixOf(row) > end + 0.001).forEach(append);
  waiting = [];
  draw(true);
  summary();
}

function cells(row, texts) {
  texts.forEach((cell, k) => put(row.cells[k] ?? row.appendChild(k ? document.createElement("td") : Object.assign(document.createElement("th"), { scope: "row" })), cell));
}

// values.js says them when somebody looks
const read = (event) => { const node = event.currentTarget; script("values.js").then(() => acqdValues(node, event)); };
const readable = (node, plot, shown) => { Object.assign(node, { plot, shown, tabIndex: 0 }); node.onkeydown ??= node.onpointerenter = read; };

function legend(list, items) {
  list.replaceChildren(...items.map(([name, stroke, dash]) => {
    const item = document.createElement("li");
    item.innerHTML = `<svg viewBox="0 0 28 8" aria-hidden="true"><path d="M0 4H28" stroke="${stroke}" stroke-width="3" stroke-dasharray="${(dash ?? []).join(" ")}"/></svg>`;
    item.append(name);
    return item;
  }));
}

function axes(first, second) {
  const grid = { stroke: colour("line"), width: 1 }, axis = { stroke: colour("ink"), grid, ticks: grid };
  return [{ ...axis, ...first }, { ...axis, size: 65, values: ticks, ...second }];
}

// where rows are missing, no line: a pause of five usual distances, and of 3 s at least
function silences(chart, _, first, last) {
  const times = chart.data[0], found = [];
  const apart = times.slice(first + 1, last + 1).map((at, k) => at - times[first + k]), usual = apart.toSorted((a, b) => a - b)[apart.length >> 1];
  apart.forEach((pause, k) => {
    if (pause > Math.max(3, 5 * usual)) found.push([first + k, first + k + 1].map((at) => Math.round(chart.valToPos(times[at], "x", true))));
  });
  return found;
}

// large values with the prefix of the unit, so that they fit beside the name of the axis
function ticks(_, values) {
  const most = Math.max(...values.map(Math.abs)), [divisor, prefix] = most < 1e5 ? [1, ""] : most < 1e8 ? [1e3, " k"] : [1e6, " M"];
  return values.map((value) => `${+(value / divisor).toPrecision(9)}${prefix}`);
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function clockTimes(_, times) {
  const whole = view.seconds > 1800, days = view.seconds > 86400 ? { month: "2-digit", day: "2-digit" } : {};
  return times.map((at) => new Date(1000 * at).toLocaleString("sv-SE", { ...days, hour: "2-digit", minute: "2-digit", ...whole ? {} : { second: "2-digit" } }));
}

function draw(anew) {
  drawn = performance.now();
  const names = Object.keys(series.channels).sort();
  const shown = view.quantity === "f" && names.includes("total") ? ["total"] : names;
  const rows = [series.time, ...shown.map((name) => series.channels[name])];
  if (view.quantity === "P" && predicted.length) {
    shown.push("predicted");
    let k = 0;
    rows.push(series.time.map((at) => {
      while (k < predicted.length - 1 && predicted[k + 1][0] <= at) k++;
      return Math.abs(predicted[k][0] - at) < 0.1 ? predicted[k][1] : null;
    }));
  }
  if (!plot || anew || plot.series.length !== rows.length) {
    if (plot) plot.destroy();
    const lines = shown.map((name) => ({ label: name, stroke: colour(name), width: name === "total" ? 2 : 1.3, dash: DASH[name], spanGaps: false, gaps: silences, points: { show: false } }));
    const option = $("quantity").selectedOptions[0];
    plot = new uPlot({
      width: $("chart").clientWidth, height: 300, legend: { show: false }, cursor: { drag: { x: true, setScale: false } },
      hooks: { setSelect: [(u) => { if (u.select.width > 5) span(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")); }] },
      scales: { x: { range: () => { const end = view.end ?? Math.max(Date.now() / 1000, series.time[series.time.length - 1] ?? 0); return [end - view.seconds, end]; } } },
      axes: axes({ label: "time (of this browser)", values: clockTimes, space: 70 }, { label: option.textContent }),
      series: [{}, ...lines],
    }, rows, $("chart"));
    readable($("chart"), plot, (x) => new Date(1000 * x).toLocaleTimeString());
    legend($("legend"), shown.map((name) => [name, colour(name), DASH[name]]));
  } else plot.setData(rows);
}

function numbers() {
  const main = latest.total ?? latest.L1;
  if (!main) return;
  for (const node of document.querySelectorAll(".big [data-of]")) {
    const name = node.dataset.of;
    if (name === "W") {
      const [value, unit] = energy(main.W ?? 0);
      put(node, main.W === null ? "-" : value.toFixed(unit === "Wh" || value >= 100 ? 2 : 3));
      put($("energy-unit"), unit);
    } else if (PREFIXED.has(name)) large(node, main[name], DIGITS[name]);
    else if (name in DIGITS) put(node, text(main[name], DIGITS[name]));
  }
  Object.assign($("big").dataset, { boot: main.boot, seq: main.seq, channel: main.channel });
  put($("flags"), main.flags.length ? `flags: ${main.flags.join(", ")}` : "");
  const body = $("phases").tBodies[0];
  Object.keys(latest).sort().forEach((name, k) => {
    const row = body.rows[k] ?? body.insertRow();
    cells(row, [name, ...["P", "Vrms", "Irms", "S", "PF"].map((q) => text(latest[name][q], DIGITS[q])), latest[name].W === null ? "-" : (1000 * latest[name].W).toFixed(2)]);
  });
  if (predicted.length && performance.now() - predicted.at < 3000) {
    const power = predicted[predicted.length - 1][1];
    $("predicted").hidden = false;
    put(document.querySelector("[data-of=predicted]"), text(power, 1));
    put($("residual"), text(main.P === null ? null : main.P - power, 1));
  } else $("predicted").hidden = true;
}

function summary() {
  const name = series.channels.total ? "total" : Object.keys(series.channels)[0];
  const values = (series.channels[name] ?? []).filter((value) => value !== null);
  if (!values.length) {
    if (view.device && !loading) put($("summary"), "no values in this span");
    return;
  }
  const [least, most] = values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
  const digits = DIGITS[view.quantity], mean = values.reduce((a, b) => a + b, 0) / values.length;
  put($("summary"), `${name}: least ${least.toFixed(digits)}, mean ${mean.toFixed(digits)}, most ${most.toFixed(digits)}; ${values.length} points${series.from ? ` from ${series.from}${view.end ? "" : ", then live"}` : ""}`);
}

// old rows that come faster than time passes are a backlog; a distance that stays is one of two clocks
function distance(lag) {
  const now = performance.now();
  if (Math.abs(lag) < 1000 * QUIET_S) {
    if (behind?.catchingUp) load();
    behind = null;
    return ["fine", "live", "Now"];
  }
  behind ??= { at: now, lag };
  if (now - behind.at > STEADY_MS) behind = { at: now, lag, clocks: Math.abs(lag - behind.lag) < 1000 };
  behind.catchingUp = lag > 0 && !behind.clocks;
  const size = `${(Math.abs(lag) / 1000).toFixed(0)} s`;
  if (behind.catchingUp) return ["open", `catching up, ${size} behind`, `${size} ago`];
  return ["open", `rows arrive, but the clocks of device and acqd web differ by ${size}`, "Newest row"];
}

function state() {
  const main = latest.total ?? latest.L1, lag = main ? lagMs(main) : 0, quiet = (performance.now() - lastRow) / 1000;
  const bad = !broker || events.readyState !== EventSource.OPEN, silent = !main || quiet > QUIET_S;
  const old = main ? `Last row, ${Math.max(quiet, lag / 1000).toFixed(0)} s ago` : "Now";
  const [kind, words, heading] = bad ? ["bad", broker ? "no connection to acqd web; trying again" : "acqd web has no connection to the broker", silent ? old : "Now"]
    : silent ? ["open", `waiting for rows${main ? ` for ${quiet.toFixed(0)} s` : ""}`, old] : distance(lag);
  put($("now"), heading);
  $("state").className = kind;
  if (put($("state"), words)) {
    const anchor = bad && !broker ? "broker-away" : bad ? "no-answer" : silent && main ? "no-rows" : "";
    if (anchor) $("state").append(" ", Object.assign(document.createElement("a"), { href: `/runbook#${anchor}`, textContent: "what to do" }));
  }
  if (kind === "fine") put($("delay"), `The newest row is ${lag < 1000 ? `${Math.round(lag)} ms` : `${(lag / 1000).toFixed(1)} s`} old (a row is 40 ms long and is made when it ends).`);
}

for (const [name, seconds] of RANGES) {
  const button = Object.assign(document.createElement("button"), { type: "button", textContent: name });
  button.setAttribute("aria-pressed", seconds === view.seconds);
  button.onclick = () => span(null, null, seconds);
  button.value = seconds;
  $("ranges").append(button);
}
$("quantity").onchange = () => { view.quantity = $("quantity").value; load(); };

// a span of the past from one time to another [Unix s], or, without them, so many seconds until now
const local = (at) => new Date(1000 * at - 60000 * new Date(1000 * at).getTimezoneOffset()).toISOString().slice(0, 19);
function span(from, to, seconds = to - from) {
  const now = serverMs() / 1000;
  view.seconds = Math.min(Math.max(seconds, 1), 366 * 86400);
  view.end = to === null || to > now ? null : to;
  for (const other of $("ranges").querySelectorAll("button")) other.setAttribute("aria-pressed", !view.end && +other.value === view.seconds);
  $("live").disabled = !view.end;
  const end = view.end ?? now;
  $("from").value = local(end - view.seconds);
  $("to").value = local(end);
  load();
}
const shift = (by, factor) => {
  const end = view.end ?? serverMs() / 1000, middle = end - view.seconds / 2 + by * view.seconds, half = factor * view.seconds / 2;
  span(middle - half, middle + half);
};
$("earlier").onclick = () => shift(-0.5, 1);
$("later").onclick = () => shift(0.5, 1);
$("closer").onclick = () => shift(0, 0.5);
$("wider").onclick = () => shift(0, 2);
$("live").onclick = () => span(null, null, view.seconds);
for (const id of ["from", "to"]) $(id).onchange = () => {
  const [from, to] = [$("from").value, $("to").value].map((at) => Date.parse(at) / 1000);
  if (to > from) span(from, to);
  else put($("summary"), "the span ends before it begins: choose another time");
};

// what is wrong, in the words of those who know; the place of it in the runbook
function wrong(who, items) {
  wrongs[who] = items;
  const all = Object.values(wrongs).flat(), words = all.map(([sentence]) => sentence).join("\n");
  if ($("wrong").dataset.words === words) return;
  $("wrong").dataset.words = words;
  $("wrong").className = all.length ? "alarm" : "alarm none";
  $("wrong").replaceChildren(...(all.length ? all : [["nothing: services are ready, no alarm is raised"]]).map(([sentence, anchor]) => {
    const item = document.createElement("li");
    item.append(sentence);
    if (anchor) item.append(" ", Object.assign(document.createElement("a"), { href: `/runbook#${anchor}`, textContent: "what to do" }));
    return item;
  }));
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw(true));
addEventListener("resize", () => plot && plot.setSize({ width: $("chart").clientWidth, height: 300 }));

const events = new EventSource("/events");
let seen = false;
events.onopen = () => { if (seen) load(); seen = true; };
events.addEventListener("beat", (event) => { serverAheadMs = 1000 * JSON.parse(event.data).time - Date.now(); });
events.addEventListener("rows", (event) => onRows(JSON.parse(event.data)));
events.addEventListener("broker", (event) => {
  const was = broker;
  broker = JSON.parse(event.data).connected;
  if (broker && !was) load();
});
events.addEventListener("prediction", (event) => {
  const { device, time, P } = JSON.parse(event.data);
  if (device !== view.device) return;
  predicted.push([time, P]);
  predicted.at = performance.now();
  while (predicted.length && predicted[0][0] < time - Math.min(view.seconds, 3600)) predicted.shift();
});
fetch("/api/devices").then((answer) => answer.ok ? answer.json() : { devices: [] }).then(({ devices }) => devices.forEach(known)).catch(() => {});
setInterval(summary, 1000);
setInterval(() => {
  const due = performance.now() - drawn > 1000 * view.seconds / PIXELS && !view.end && !plot?.select.width;
  if (due && !loading && plot && document.visibilityState === "visible") draw(false);
}, 100);
setInterval(state, 500);
