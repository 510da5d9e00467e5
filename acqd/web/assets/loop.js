"use strict";
{
  const VERDICTS = {
    effects_found: "A missing effect was found.",
    nothing_left: "The residual shows no credible effect.",
    unknown_structure: "The residual has a structure that no effect of the library explains.",
    not_identifiable: "The residual has a structure, but these recordings cannot identify its cause.",
  };
  let current = { job: {} };
  const element = (name, content, properties = {}) => {
    const node = Object.assign(document.createElement(name), properties);
    node.append(...[content].flat());
    return node;
  };
  const number = (value, digits = 3) => typeof value === "number" ? Number(value.toPrecision(digits)).toString() : "-";

  function effects(result) {
    return (result.effects ?? []).map((effect) => {
      const values = Object.entries(effect.parameters).map(([name, p]) => `${name} ${number(p.value)} ${p.unit}${p.ci95 ? ` (${number(p.ci95[0])} to ${number(p.ci95[1])})` : ""}`);
      return element("li", `${effect.id}, ${effect.where}: ${values.join(", ")}; confidence ${(100 * effect.confidence).toFixed(0)} %${effect.added ? "" : "; reported, not added to the model"}`);
    });
  }

  function correction({ follows, looks_like: likeness, size }) {
    const interval = size.ci95 ? ` (${number(size.ci95[0])} to ${number(size.ci95[1])})` : "";
    return `The model was corrected by ${follows}${likeness ? `, like ${likeness}` : ""}: up to ${number(size.value)} ${size.unit}${interval}. The cause is unknown.`;
  }

  function tile(result, title) {
    const box = element("div", [element("p", title), element("p", element("b", VERDICTS[result.verdict] ?? "The result cannot be read."))], { className: "tile" });
    if (result.before && result.after) box.append(element("p", `Error on held-out recordings: ${result.before.rmse.toFixed(2)} W before, ${result.after.rmse.toFixed(2)} W after${result.recordings ? ` (${result.recordings.fit} recordings to fit, ${result.recordings.held_out} held out)` : ""}.`));
    if (result.effects?.length) box.append(element("ul", effects(result)));
    if (result.verdict && !result.effects?.length) box.append(element("p", result.unexplained ?? ""));
    if (result.correction) box.append(element("p", correction(result.correction)));
    if (result.next?.length) box.append(element("p", "What to do next:"), element("ul", result.next.map((step) => element("li", step))));
    box.append(element("p", element("a", "open the report", { href: "/report", target: "_blank", rel: "noopener" })));
    return box;
  }

  async function newest() {
    const result = await (await fetch("/api/report")).json();
    $("report").hidden = !result.name || current.job?.state === "done";
    if (result.name) {
      $("loop-section").hidden = false;
      $("report").replaceChildren(tile(result, `Newest report: ${result.name}, ${new Date(1000 * result.written).toISOString().slice(0, 16).replace("T", " ")} UTC`));
    }
  }

  function show(state) {
    current = state;
    if (!state.enabled) return;
    $("loop-section").hidden = $("loop-controls").hidden = false;
    const { job, alarms } = state, running = job.state === "running";
    put($("loop-start"), view.device ? `Find the cause (power of ${view.device})` : "Find the cause");
    const choices = alarms.map((alarm) => String(alarm.onset_s)).join();
    if ($("alarms").dataset.choices !== choices) {
      $("alarms").dataset.choices = choices;
      $("alarms").replaceChildren(...alarms.map((alarm) => new Option(`${new Date(1000 * alarm.onset_s).toISOString().slice(0, 19).replace("T", " ")} UTC, ${alarm.chart}`, alarm.onset_s)));
    }
    $("loop-start").disabled = running || !alarms.length;
    $("loop-cancel").hidden = $("loop-progress").hidden = !running;
    $("loop-progress").value = job.share;
    const words = {
      idle: alarms.length ? "" : "There is no alarm: nothing to search for.",
      running: `part ${job.part} of 2, ${job.part === 1 ? "dataset" : "search"}: ${job.step}; ${job.recordings} recordings, ${(Date.now() / 1000 - job.begun).toFixed(0)} s so far`,
      done: `The search took ${(job.ended - job.begun).toFixed(0)} s. Nothing was changed.`,
      failed: `The search ended without a result: ${job.error}`,
      cancelled: "The search was cancelled; nothing was changed.",
    };
    put($("loop-note"), words[job.state]);
    const proposal = job.state === "done" && state.proposal, done = state.applied[0]?.proposal.includes(`/${job.folder}/`);
    $("proposal").hidden = !proposal;
    if (proposal && $("proposal").dataset.folder !== job.folder) {
      $("proposal").dataset.folder = job.folder;
      $("proposal").replaceChildren(tile(proposal, `Proposal from ${job.recordings} recordings`));
    }
    $("report").hidden = $("report").hidden || proposal;
    $("apply").hidden = !proposal || !(proposal.correction || proposal.effects?.some((effect) => effect.added)) || done;
    $("applied").replaceChildren(...state.applied.map((line) => element("li", `${line.time}: ${line.name} replaced the model; the old one is ${line.kept}. Restart acqd sidecar to use it.`)));
  }

  async function ask(path, body) {
    const options = body && { method: "POST", headers: { "content-type": "application/json", "x-acqd": "page" }, body: JSON.stringify(body) };
    try {
      const answer = await fetch(path, options), state = await answer.json();
      if (answer.ok) show(state);
      else put($("loop-note"), state.error);
    } catch { /* asked again soon */ }
  }

  $("loop-start").onclick = () => ask("/api/loop/start", { device: view.device, since: Number($("alarms").value) });
  $("loop-cancel").onclick = () => ask("/api/loop/cancel", {});
  $("apply").onsubmit = (event) => {
    event.preventDefault();
    ask("/api/loop/apply", { folder: current.job.folder, name: $("apply-name").value });
  };
  const look = () => document.visibilityState === "visible" && ask("/api/loop").then(() => newest()).catch(() => {});
  setInterval(() => current.job?.state === "running" && look(), 1000);
  setInterval(look, 15000);
  look();
}
