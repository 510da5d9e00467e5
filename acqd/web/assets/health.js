"use strict";
{
  const LOOK_MS = 5000;

  function report(cell, details, runbook) {
    const words = details.join("\n");
    if (cell.dataset.words === words) return;
    cell.dataset.words = words;
    cell.replaceChildren(details.length ? document.createElement("ul") : "nothing to report");
    for (const sentence of details) {
      const item = cell.firstChild.appendChild(document.createElement("li"));
      item.append(sentence);
      if (!runbook[sentence]) continue;
      item.append(" ", Object.assign(document.createElement("a"), { href: `/runbook#${runbook[sentence]}`, textContent: "what to do" }));
    }
  }

  const bytes = (count) => count < 1e6 ? `${(count / 1e3).toFixed(0)} kB` : `${(count / 1e6).toFixed(1)} MB`;
  const seconds = (age) => age < 120 ? `${age.toFixed(1)} s` : age < 7200 ? `${(age / 60).toFixed(0)} min` : `${(age / 3600).toFixed(1)} h`;
  const link = (peer) => peer && `${peer.connected ? "connected" : "away"}${peer.reconnects ? `, reconnections: ${peer.reconnects}` : ""}`;

  function tiles(services) {
    const of = (name) => services.find((service) => service.service === name)?.status ?? {};
    const daemon = of("daemon"), sink = of("sink"), delivery = daemon.delivery ?? {};
    const shown = [
      ["source", link(daemon.source) && `${link(daemon.source)}; ${daemon.source.lost} samples lost`],
      ["windows in doubt", daemon.windows && flagged(daemon.windows).filter(Boolean).join("; flags: ")],
      ["broker", link(daemon.broker)],
      ["rows on their way", delivery.waiting !== undefined && `${delivery.waiting} wait, ${delivery.receipts_outstanding ?? 0} without receipt`],
      ["spool", Number.isFinite(delivery.spool_bytes) && [`${bytes(delivery.spool_bytes)} of ${bytes(delivery.spool_limit_bytes)}`, delivery.spool_bytes / delivery.spool_limit_bytes]],
      ["oldest row that waits", Number.isFinite(delivery.spool_age_s) && seconds(delivery.spool_age_s)],
      ["dropped", delivery.dropped !== undefined && `${delivery.dropped} messages`],
      ["database", link(sink.database)],
      ["stored", sink.rows !== undefined && `${sink.rows} rows${Number.isFinite(sink.last_row_age_s) ? `, the last ${seconds(sink.last_row_age_s)} ago` : ""}`],
      ["quarantine", Number.isFinite(sink.quarantined) && `${sink.quarantined} messages`],
    ].filter(([, value]) => value);
    $("delivery").replaceChildren(...shown.map(([name, value]) => {
      const tile = document.createElement("div"), [words, share] = [value].flat();
      tile.append(Object.assign(document.createElement("dt"), { textContent: name }), Object.assign(document.createElement("dd"), { textContent: words }));
      if (share !== undefined) {
        const meter = Object.assign(document.createElement("meter"), { min: 0, max: 1, high: 0.9, optimum: 0, value: share });
        meter.setAttribute("aria-label", "share of the spool's limit");
        tile.lastChild.append(meter);
      }
      return tile;
    }));
  }

  const stateOf = (box) => box.ended ? ["ended", "open"] : !box.source.connected ? ["away", "bad"] : box.alive ? ["delivers", "fine"] : ["no rows", "bad"];

  function flagged(windows) {
    const names = Object.entries(windows.flags).sort((one, other) => other[1] - one[1]);
    return [`${windows.flagged} of ${windows.made}`, names.map(([name, count]) => `${name} ${count}`).join(", ")];
  }

  function sources(boxes) {
    $("sources").hidden = !boxes.length;
    $("boxes").tBodies[0].replaceChildren(...boxes.map((box) => {
      const row = document.createElement("tr"), [state, looks] = stateOf(box), [count, names] = flagged(box.windows);
      const again = box.restarts + (box.cycles?.restarts ?? 0), age = box.last_row_age_s;
      cells(row, [box.name, state, Number.isFinite(age) ? seconds(age) : "-", box.source.lost, again, count, box.cycles?.missed ?? "-", box.cycles?.exceeded ?? "-"].map(String));
      row.cells[1].className = looks;
      row.cells[5].append(Object.assign(document.createElement("small"), { textContent: names }));
      return row;
    }));
  }

  const time = (us) => us < 1000 ? `${us} µs` : `${us / 1000} ms`;

  function histogram(table, times) {
    const body = table.tBodies[0];
    body.replaceChildren();
    const filled = times.counts.map((count, k) => count ? k : -1).filter((k) => k >= 0);
    if (!filled.length) return;
    const most = Math.log10(1 + Math.max(...times.counts));
    for (let k = filled[0]; k <= filled[filled.length - 1]; k++) {
      const low = k ? times.upper_us[k - 1] : 0, high = times.upper_us[k];
      const row = body.insertRow();
      cells(row, [high === undefined ? `over ${time(low)}` : `${low ? `${time(low)} to ` : "up to "}${time(high)}`, String(times.counts[k])]);
      const bar = row.insertCell().appendChild(document.createElement("i"));
      bar.style.width = `${100 * Math.log10(1 + times.counts[k]) / most}%`;
    }
  }

  async function health() {
    try {
      const { services, runbook, page } = await (await fetch("/api/health")).json();
      if (page.files && !view.files) {
        view.files = true;
        style("files.css");
        await script("files.js");
      }
      const body = $("services").tBodies[0];
      while (body.rows.length > services.length) body.deleteRow(-1);
      services.forEach((service, k) => {
        const row = body.rows[k] ?? body.insertRow();
        while (row.cells.length < 3) row.insertCell();
        put(row.cells[0], service.service);
        put(row.cells[1], service.ready ? "ready" : "not ready");
        row.cells[1].className = service.ready ? "fine" : "bad";
        report(row.cells[2], [...service.problems, ...service.notes], runbook);
      });
      wrong("services", !services.length ? [["nobody asks the services: [health] port and sink_port are 0"]] : services.flatMap((service) => service.problems.map((sentence) => [`${service.service}: ${sentence}`, runbook[sentence]])));
      tiles(services);
      const daemon = services.find((service) => service.service === "daemon")?.status ?? {}, boxes = daemon.boxes ?? [];
      sources(boxes);
      const box = boxes.find((each) => each.devices.includes(view.device)), cycles = box?.cycles ?? (box ? null : daemon.cycles);
      document.querySelectorAll("#cycles .of").forEach((node) => put(node, box ? ` of ${box.name}` : ""));
      $("cycles").hidden = !cycles?.latency;
      if (cycles?.latency) histogram($("fast"), cycles.latency);
      if (cycles?.slow) histogram($("slow"), cycles.slow);
    } catch { /* asked again soon */ }
  }

  setInterval(() => document.visibilityState === "visible" && health(), LOOK_MS);
  onDevice.push(health);
  health();
}
