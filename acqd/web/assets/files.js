"use strict";
{
  const KINDS = { waveform: "waveform", power: "power", log: "log", part: "part", unknown: "not read", "": "waiting" };
  const LOOK_MS = 1000;
  const span = (s) => s < 120 ? `${s.toFixed(0)} s` : s < 7200 ? `${(s / 60).toFixed(0)} min` : `${(s / 3600).toFixed(1)} h`;
  $("health-section").insertAdjacentHTML("beforebegin", `<section aria-labelledby="files" id="files-section" hidden><h2 id="files">Your files</h2>
    <div class="controls drop"><label>Waveforms, logs of the robot, rows of power: drop them on the page, or choose <input type="file" multiple id="files-input"></label><button type="button" id="files-cancel" hidden>Cancel</button></div>
    <p class="note" id="files-note" role="status"></p><p class="note" id="files-seconds"></p><progress id="files-progress" max="1" value="0" aria-label="Progress of the files" hidden></progress>
    <div class="scroll" tabindex="0" role="region" aria-label="Files" hidden><table id="files-table"><thead><tr><th scope="col">file</th><th scope="col">kind</th><th scope="col">what was seen</th></tr></thead><tbody></tbody></table></div>
    <ul id="files-results"></ul>
    </section>`);
  let state = { state: "idle" }, sending = false, visit = "", timer = 0;

  function show(now) {
    state = now;
    if (!state.enabled) return;
    $("files-section").hidden = false;
    const busy = sending || state.state === "running";
    $("files-cancel").hidden = $("files-progress").hidden = !busy;
    $("files-input").disabled = busy;
    if (!sending) $("files-progress").value = state.share ?? 0;
    const words = {
      idle: "", receiving: "", running: state.step,
      done: `Done in ${span(state.ended - state.begun)}. The files were not kept.${state.removed ? ` Oldest results removed: ${state.removed} ([web] files_kept, files_kept_MB).` : ""}`,
      failed: `Nothing came of it: ${state.error}`, cancelled: "Cancelled; nothing was kept.",
    };
    if (!sending) put($("files-note"), words[state.state]);
    // outside of the status, which would be read aloud every second
    $("files-seconds").textContent = state.state === "running" ? `${span(Date.now() / 1000 - state.begun)} so far` : "";
    $("files-note").className = state.state === "failed" ? "note bad" : "note";
    const body = $("files-table").tBodies[0];
    $("files-table").parentNode.hidden = !state.files?.length;
    body.replaceChildren();
    for (const { name, kind, says } of state.files ?? []) {
      const row = body.insertRow();
      cells(row, [name, KINDS[kind], says]);
      if (kind === "unknown") row.cells[1].className = "bad";
    }
    const titles = { dataset: "report of the dataset", result: "closing report" };
    $("files-results").replaceChildren(...(state.state === "done" ? state.pages : []).map((page) => {
      const item = document.createElement("li");
      item.append(Object.assign(document.createElement("a"), { href: `/files/${state.folder}/${page}/report.html`, target: "_blank", rel: "noopener", textContent: titles[page] }));
      return item;
    }));
    clearTimeout(timer);
    if (state.state === "running") timer = setTimeout(() => ask("/api/files"), LOOK_MS);
  }

  // throws an Error with the page's line
  async function post(path, body) {
    const answer = await fetch(path, { method: "POST", headers: { "x-acqd": "page", "content-type": "application/octet-stream" }, body });
    const said = await answer.text();
    let content = null;
    try { content = JSON.parse(said); } catch { /* a proxy in between has answered */ }
    if (answer.ok && content) return content;
    const line = answer.headers.get("content-type")?.startsWith("text/plain") ? said : `the answer was ${answer.status}: is acqd web running?`;
    throw new Error(answer.status === 413 ? "the file is larger than the proxy lets pass; see its client_max_body_size" : content?.error ?? line);
  }
  const cancel = (whose) => post(`/api/files/cancel?${new URLSearchParams({ visit: whose })}`, "").then(show).catch(() => {});
  const ask = async (path) => { try { show(await (await fetch(path)).json()); } catch { timer = setTimeout(() => ask(path), LOOK_MS); } };

  async function send(files) {
    if (!files.length || sending || state.state === "running") return;
    sending = true;
    const own = visit = crypto.getRandomValues(new Uint32Array(2)).join("-");
    let trouble = "";
    try {
      for (const [k, file] of [...files].entries()) {
        put($("files-note"), `sending ${file.name}, ${k + 1} of ${files.length}`);
        $("files-progress").value = k / files.length;
        if (visit !== own) return; // cancelled meanwhile
        show(await post(`/api/files/add?${new URLSearchParams({ name: file.name, visit: own })}`, file));
      }
      sending = false;
      show(await post(`/api/files/start?${new URLSearchParams({ visit: own })}`, ""));
    } catch (error) { trouble = error instanceof TypeError ? "the file could not be sent" : error.message; }
    if (visit !== own) return;
    sending = false;
    if (!trouble) return;
    await cancel(own); // does nothing to files of another visitor
    show({ ...state, state: "failed", error: trouble });
  }

  $("files-input").onchange = () => send($("files-input").files).then(() => { $("files-input").value = ""; });
  $("files-cancel").onclick = () => { cancel(sending ? visit : state.visit); sending = false; visit = ""; };
  addEventListener("dragover", (event) => {
    if (!state.enabled || !event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    document.body.classList.add("over");
  });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) document.body.classList.remove("over"); });
  addEventListener("drop", (event) => {
    document.body.classList.remove("over");
    if (!state.enabled || !event.dataTransfer?.files.length) return;
    event.preventDefault();
    $("files-section").scrollIntoView();
    send(event.dataTransfer.files);
  });
  ask("/api/files");
}
