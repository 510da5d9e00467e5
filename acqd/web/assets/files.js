"use strict";
{
  const KINDS = { waveform: "waveform", power: "power", log: "log", part: "part", unknown: "not read", "": "waiting" };
  const LOOK_MS = 1000, visit = crypto.getRandomValues(new Uint32Array(2)).join("-");
  $("health-section").insertAdjacentHTML("beforebegin", `<section aria-labelledby="files" id="files-section" hidden><h2 id="files">Your files</h2>
    <div class="controls drop"><label>Waveforms, logs of the robot, rows of power: drop them on the page, or choose <input type="file" multiple id="files-input"></label><button type="button" id="files-cancel" hidden>Cancel</button></div>
    <p class="note" id="files-note" role="status"></p><progress id="files-progress" max="1" value="0" aria-label="Progress of the files" hidden></progress>
    <div class="scroll" tabindex="0" role="region" aria-label="Files" hidden><table id="files-table"><thead><tr><th scope="col">file</th><th scope="col">kind</th><th scope="col">what was seen</th></tr></thead><tbody></tbody></table></div>
    <ul id="files-results"></ul>
    </section>`);
  let state = { state: "idle" }, sending = false, timer = 0;

  function show(now) {
    state = now;
    if (!state.enabled) return;
    $("files-section").hidden = false;
    const busy = sending || state.state === "running";
    $("files-cancel").hidden = $("files-progress").hidden = !busy;
    $("files-input").disabled = busy;
    if (!sending) $("files-progress").value = state.share ?? 0;
    const words = {
      idle: "", receiving: "", running: `${state.step}; ${(Date.now() / 1000 - state.begun).toFixed(0)} s so far`,
      done: `Done in ${(state.ended - state.begun).toFixed(0)} s. The files were not kept.`,
      failed: `Nothing came of it: ${state.error}`, cancelled: "Cancelled; nothing was kept.",
    };
    if (!sending) put($("files-note"), words[state.state]);
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
    const content = await answer.json();
    if (!answer.ok) throw new Error(content.error);
    return content;
  }
  const ask = async (path) => { try { show(await (await fetch(path)).json()); } catch { timer = setTimeout(() => ask(path), LOOK_MS); } };

  async function send(files) {
    if (!files.length || sending || state.state === "running") return;
    sending = true;
    let trouble = "";
    try {
      for (const [k, file] of [...files].entries()) {
        put($("files-note"), `sending ${file.name}, ${k + 1} of ${files.length}`);
        $("files-progress").value = k / files.length;
        if (!sending) throw new Error("cancelled");
        show(await post(`/api/files/add?${new URLSearchParams({ name: file.name, visit })}`, file));
      }
      sending = false;
      show(await post("/api/files/start", ""));
    } catch (error) { trouble = error instanceof TypeError ? "the file could not be sent" : error.message; }
    sending = false;
    if (!trouble) return;
    if (state.state === "receiving") await post("/api/files/cancel", "").then(show).catch(() => {});
    show({ ...state, state: "failed", error: trouble });
  }

  $("files-input").onchange = () => send($("files-input").files).then(() => { $("files-input").value = ""; });
  $("files-cancel").onclick = () => { sending = false; post("/api/files/cancel", "").then(show).catch(() => {}); };
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
