"use strict";
{
  const LOOK_MS = 60000, alarms = {}, online = {}, days = {};
  const kWh = (value) => value === null || value === undefined ? ["-", "kWh"] : (([size, unit]) => [size.toFixed(unit === "Wh" ? 0 : 2), unit])(energy(value));

  async function ask(device) {
    try {
      const answer = await fetch(`/api/energy?${new URLSearchParams({ device })}`);
      if (answer.ok) days[device] = await answer.json();
    } catch { /* asked again soon */ }
  }

  function tiles() {
    for (const node of document.querySelectorAll("[data-energy]")) {
      const of = days[view.device]?.[node.dataset.energy], [value, unit] = kWh(of?.kWh), notes = [];
      put(node, value);
      put(node.nextElementSibling, unit);
      if (Number.isFinite(of?.EUR)) notes.push(`${of.unpriced_kWh ? "at least " : ""}${of.EUR.toFixed(2)} EUR`);
      if (of?.missing_s > 60) notes.push(`${of.missing_s < 5400 ? `${Math.round(of.missing_s / 60)} min` : `${(of.missing_s / 3600).toFixed(1)} h`} without rows`);
      put(node.parentNode.lastElementChild, notes.join(", "));
      node.title = days[view.device]?.zone ?? "";
    }
    comparisons(days[view.device] ?? {});
  }

  // of the energy of a week; what cannot be known stays "-", with the reason
  function comparisons({ against_last_week: against, last_week: last, standby_share: share, price, feed_in: feedIn, trouble }) {
    put($("against"), Number.isFinite(against?.change) ? `${against.change < 0 ? "-" : "+"}${(100 * Math.abs(against.change)).toFixed(1)}` : "-");
    put($("against-of"), !against ? "no rows of last week until this hour" : against.quantity === "kWh" ? `${kWh(last.kWh).join(" ")} until this hour` : "mean power: rows lack");
    put($("standby"), Number.isFinite(share) ? (100 * share).toFixed(share < 0.0995 ? 1 : 0) : "-");
    put($("standby-of"), Number.isFinite(share) ? "of the energy" : "rest and work are not told apart");
    const P = (latest.total ?? latest.L1)?.P, euros = Number.isFinite(P) && Number.isFinite(price) ? P / 1000 * (P < 0 ? feedIn : price) : NaN;
    put($("cost-now"), Number.isFinite(euros) ? `${euros.toFixed(Math.abs(euros) < 0.1 ? 4 : 2)} EUR/h` : trouble ? "no price now" : "");
    wrong("tariff", trouble ? [[trouble]] : []);
  }

  function stateOf(device) {
    const main = newest[device].total ?? newest[device].L1, quiet = (performance.now() - heard[device]) / 1000;
    if (online[device] === false) return ["offline", "bad"];
    if (!main) return ["no rows yet", "open"];
    if (quiet > QUIET_S) return [`no rows for ${quiet.toFixed(0)} s`, "bad"];
    const lag = lagMs(main) / 1000;
    return Math.abs(lag) < QUIET_S ? ["live", "fine"] : [`${lag.toFixed(0)} s behind`, "open"];
  }

  function newRow(body) {
    const row = body.insertRow(), name = row.appendChild(Object.assign(document.createElement("th"), { scope: "row" }));
    name.appendChild(Object.assign(document.createElement("button"), { type: "button" }));
    for (let k = 0; k < 4; k++) row.insertCell();
    return row;
  }

  function table() {
    const names = Object.keys(newest).sort(), body = $("fleet").tBodies[0];
    $("glance").hidden = names.length < 2;
    tiles();
    if (names.length < 2) return;
    names.forEach((device, k) => {
      const row = body.rows[k] ?? newRow(body), [state, looks] = stateOf(device);
      const P = (newest[device].total ?? newest[device].L1)?.P;
      [state, Number.isFinite(P) ? `${P.toFixed(1)} W` : "-", kWh(days[device]?.today?.kWh).join(" "), alarms[device] ?? "none"].forEach((words, at) => put(row.cells[at + 1], words));
      row.cells[1].className = looks;
      row.cells[4].className = alarms[device] ? "bad" : "";
      const button = row.cells[0].firstElementChild;
      put(button, device);
      button.setAttribute("aria-pressed", device === view.device);
      button.onclick = () => choose(device);
    });
  }

  events.addEventListener("status", (event) => { const { device, online: now } = JSON.parse(event.data); online[device] = now; });
  events.addEventListener("alarm", (event) => {
    const { device, alarm } = JSON.parse(event.data), since = alarm && new Date(1000 * alarm.onset_s).toISOString().slice(0, 16).replace("T", " ");
    if (alarm) alarms[device] = `residual changed since ${since} UTC`;
    else delete alarms[device];
    wrong("alarms", Object.entries(alarms).map(([name, words]) => [`${name}: ${words}`]));
  });
  async function all() {
    for (const device of [view.device, ...Object.keys(newest).filter((name) => name !== view.device)]) if (device) await ask(device);
    table();
  }
  onDevice.push(() => ask(view.device).then(table));
  setInterval(all, LOOK_MS);
  setTimeout(all, 3000);
  setInterval(table, 1000);
}
