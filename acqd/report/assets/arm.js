"use strict";
// The arm in motion with its power and residual by cause, on one slider. Links are drawn from the placements of the
// joints; a drawing from two sides stands until three.js is there, and where a browser has no WebGL.
const acqdArm = (() => {
  const TICKS = 4, FINE = { predicted: 220, residual: 150 }, NEUTRAL_SHARE = 0.15, ZOOM = 1.15, TURN = 0.12;
  const element = (name, properties = {}, ...content) => {
    const node = Object.assign(document.createElement(name), properties);
    node.append(...content);
    return node;
  };
  const watts = (value) => Math.abs(value) < 99.95 ? value.toFixed(1) : value.toFixed(0);

  // placements are the rows of [R | p], 12 numbers
  function placed(a, b) {
    const out = [];
    for (let r = 0; r < 3; r++) for (let c = 0; c < 4; c++) {
      let sum = c === 3 ? a[4 * r + 3] : 0;
      for (let k = 0; k < 3; k++) sum += a[4 * r + k] * b[4 * k + c];
      out.push(sum);
    }
    return out;
  }
  function moved({ axis: [x, y, z], slides }, q) {
    if (slides) return [1, 0, 0, q * x, 0, 1, 0, q * y, 0, 0, 1, q * z];
    const c = Math.cos(q), s = Math.sin(q), v = 1 - c; // Rodrigues
    return [c + x * x * v, x * y * v - z * s, x * z * v + y * s, 0, y * x * v + z * s, c + y * y * v, y * z * v - x * s, 0, z * x * v - y * s, z * y * v + x * s, c + z * z * v, 0];
  }
  const origin = (m) => [m[3], m[7], m[11]];

  // positions [m] of base, joints and flange, and the directions of the joints' axes
  function posture(frames, q) {
    let at = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
    const points = [[0, 0, 0]], axes = [];
    frames.joints.forEach((joint, k) => {
      at = placed(placed(at, joint.at), moved(joint, q[k]));
      points.push(origin(at));
      axes.push([0, 1, 2].map((r) => at[4 * r] * joint.axis[0] + at[4 * r + 1] * joint.axis[1] + at[4 * r + 2] * joint.axis[2]));
    });
    points.push(origin(placed(at, frames.flange)));
    return { points, axes };
  }

  // m from the base to the flange of a straight arm, with sliding joints at an end of their travel
  const reach = ({ joints, flange }) => [...joints.map(({ at }) => at), flange].reduce((sum, at) => sum + Math.hypot(...origin(at)), 0) + joints.reduce((sum, { travel }) => sum + travel, 0);

  function flat(host, { points }, colours, reach) {
    const scale = 130 / reach;
    const views = [["from the side", ([x, , z]) => [160 + scale * x, 230 - scale * z], 230], ["from above", ([x, y]) => [480 + scale * x, 160 - scale * y], 160]];
    host.innerHTML = `<svg viewBox="0 0 640 320" role="img" aria-label="Posture of the arm from the side and from above">${views.map(([name, at, floor], k) => {
      const places = points.map(at).map(([a, b]) => [a.toFixed(1), b.toFixed(1)]);
      return `<text x="${k * 320 + 12}" y="24">${name}</text>${k ? "" : `<path class="floor" d="M20 ${floor}h280"/>`}<polyline class="link" points="${places.join(" ")}"/>${places.map(([a, b], n) => `<circle cx="${a}" cy="${b}" r="5" fill="${colours[n - 1] ?? "var(--paper)"}"/>`).join("")}`;
    }).join("")}</svg>`;
  }

  // the scene of three.js; throws where the browser has no WebGL
  class Space {
    constructor(THREE, host, frames, reach) {
      this.THREE = THREE;
      this.host = host;
      this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
      this.scene = new THREE.Scene();
      this.camera = new THREE.PerspectiveCamera(35, 2, 0.01, 60 * reach);
      this.camera.up.set(0, 0, 1);
      this.around = { azimuth: -0.9, elevation: 0.42, distance: 2.45 * reach };
      this.centre = new THREE.Vector3(0, 0, 0.36 * reach);
      const sun = new THREE.DirectionalLight(0xffffff, 2.2);
      sun.position.set(reach, -2 * reach, 3 * reach);
      const grid = new THREE.GridHelper(1.6 * reach, 8, 0x888888, 0x888888);
      grid.rotation.x = Math.PI / 2;
      Object.assign(grid.material, { transparent: true, opacity: 0.45 });
      this.scene.add(new THREE.AmbientLight(0xffffff, 1.3), sun, grid);
      const body = (geometry, colour) => {
        const mesh = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: colour }));
        this.scene.add(mesh);
        return mesh;
      };
      const thick = 0.034 * reach;
      const pipe = new THREE.CylinderGeometry(thick, thick, 1, 24), ball = new THREE.SphereGeometry(thick, 24, 16);
      this.links = Array.from({ length: frames.joints.length + 1 }, () => body(pipe, 0xb8c1cc));
      this.balls = this.links.map(() => body(ball, 0xb8c1cc));
      this.joints = frames.joints.map(({ slides }) => body(new THREE.CylinderGeometry(1.55 * thick, 1.55 * thick, 3.4 * thick, slides ? 4 : 28), 0xb8c1cc));
      this.flange = body(new THREE.CylinderGeometry(1.2 * thick, 1.2 * thick, 0.5 * thick, 24), 0x52606d);
      body(new THREE.CylinderGeometry(2.4 * thick, 2.6 * thick, thick, 32), 0x7d8894).rotation.x = Math.PI / 2;
      const canvas = this.renderer.domElement;
      canvas.setAttribute("aria-hidden", "true"); // the group around it has the name
      host.replaceChildren(canvas);
      this.turning();
      this.fit();
    }

    turning() {
      let from = null;
      const canvas = this.renderer.domElement;
      canvas.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
      canvas.addEventListener("pointermove", (event) => {
        if (!from) return;
        this.turn(-(event.clientX - from[0]) / 150, (event.clientY - from[1]) / 150);
        from = [event.clientX, event.clientY];
      });
      for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { from = null; });
      this.host.addEventListener("keydown", (event) => {
        const by = { ArrowLeft: [-TURN, 0], ArrowRight: [TURN, 0], ArrowUp: [0, TURN], ArrowDown: [0, -TURN] }[event.key];
        const zoom = { "+": 1 / ZOOM, "=": 1 / ZOOM, "-": ZOOM }[event.key];
        if (!by && !zoom || event.ctrlKey || event.metaKey) return;
        event.preventDefault();
        this.around.distance *= zoom ?? 1;
        this.turn(...(by ?? [0, 0]));
      });
    }

    turn(azimuth, elevation) {
      this.around.azimuth += azimuth;
      this.around.elevation = Math.min(1.5, Math.max(-0.3, this.around.elevation + elevation));
      this.draw();
    }

    fit() {
      const width = this.host.clientWidth || 600, height = Math.round(Math.min(0.62 * width + 60, 430));
      this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      // a narrow view opens wider, so that an arm stretched out to a side stays in it
      this.camera.fov = 360 / Math.PI * Math.atan(Math.tan(35 * Math.PI / 360) * Math.max(1, 1.7 / this.camera.aspect));
      this.camera.updateProjectionMatrix();
      this.draw();
    }

    show({ points, axes }, colours) {
      const { Vector3 } = this.THREE, up = new Vector3(0, 1, 0), places = points.map((point) => new Vector3(...point));
      this.links.forEach((link, k) => {
        const between = places[k + 1].clone().sub(places[k]), length = between.length();
        link.visible = length > 1e-3;
        if (!link.visible) return;
        link.scale.y = length;
        link.position.copy(places[k]).addScaledVector(between, 0.5);
        link.quaternion.setFromUnitVectors(up, between.divideScalar(length));
      });
      this.balls.forEach((ball, k) => ball.position.copy(places[k + 1]));
      this.joints.forEach((joint, k) => {
        joint.position.copy(places[k + 1]);
        joint.quaternion.setFromUnitVectors(up, new Vector3(...axes[k]).normalize());
        joint.material.color.set(colours[k] ?? "#b8c1cc");
      });
      this.flange.position.copy(places.at(-1));
      this.flange.quaternion.copy(this.links.findLast((link) => link.visible)?.quaternion ?? this.flange.quaternion);
      this.draw();
    }

    draw() {
      const { azimuth, elevation, distance } = this.around;
      this.camera.position.set(Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)).multiplyScalar(distance).add(this.centre);
      this.camera.lookAt(this.centre);
      this.renderer.render(this.scene, this.camera);
    }
  }

  // layers stacked above and below zero, with lines over them, as SVG
  class Course {
    constructor(kind, title, choose) {
      Object.assign(this, { kind, title });
      this.plot = element("div", { className: "course" });
      this.values = element("ul", { className: "layers" });
      this.node = element("div", {}, element("h3", { textContent: title }), this.plot, this.values);
      const pick = (event) => {
        const box = this.plot.getBoundingClientRect(), { left, right } = this.edges;
        choose((event.clientX - box.left - left) / (box.width - left - right));
      };
      this.plot.addEventListener("pointerdown", (event) => { this.plot.setPointerCapture(event.pointerId); pick(event); });
      this.plot.addEventListener("pointermove", (event) => event.buttons && pick(event));
    }

    set(motion) {
      this.motion = motion;
      this.layers = motion[this.kind];
      const rows = motion.t.length, above = Array(rows).fill(0), below = Array(rows).fill(0);
      this.areas = this.layers.map(({ W }) => {
        const bands = [above, below].map((edge, side) => {
          const inner = edge.slice();
          for (let k = 0; k < rows; k++) if (side ? W[k] < 0 : W[k] > 0) edge[k] += W[k];
          return [inner, edge.slice()];
        });
        return bands;
      });
      const total = this.layers.length ? this.layers[0].W.map((_, k) => this.layers.reduce((sum, { W }) => sum + W[k], 0)) : [];
      this.lines = this.kind === "predicted" ? [["predicted", "total", total], ["measured", "measured", motion.measured]] : this.layers.length > 1 ? [["residual", "total", total]] : [];
      this.node.firstChild.textContent = this.layers.length > 1 ? this.title : this.title.replace(" by cause", "");
      const drawn = this.lines.flatMap(([, , values]) => values).filter(Number.isFinite);
      this.low = drawn.concat(below).reduce((a, b) => Math.min(a, b), 0);
      this.high = drawn.concat(above).reduce((a, b) => Math.max(a, b), this.low + 1);
      const entry = (name, swatch) => element("li", {}, swatch, element("span", { textContent: name }), element("b"));
      this.values.replaceChildren(
        ...this.lines.map(([name, looks]) => entry(name, element("i", { className: looks === "measured" ? "line dashed" : "line" }))),
        ...this.layers.map(({ name, colour }) => entry(name, element("i", { style: `background: ${colour}` }))),
      );
      this.draw();
    }

    draw() {
      if (!this.motion) return;
      const width = Math.max(this.plot.clientWidth, 240), height = FINE[this.kind], [left, right, top, bottom] = [52, 6, 6, 34];
      this.edges = { left, right };
      const t = this.motion.t, first = t[0], span = t.at(-1) - first || 1;
      this.x = (k) => left + (width - left - right) * (t[k] - first) / span;
      const y = (value) => top + (height - top - bottom) * (this.high - value) / (this.high - this.low);
      const path = (values) => values.map((value, k) => Number.isFinite(value) ? `${k && Number.isFinite(values[k - 1]) ? "L" : "M"}${this.x(k).toFixed(1)} ${y(value).toFixed(1)}` : "").join("");
      const band = ([inner, outer]) => inner.some((value, k) => value !== outer[k]) ? `${path(outer)}${inner.map((_, k) => inner.length - 1 - k).map((k) => `L${this.x(k).toFixed(1)} ${y(inner[k]).toFixed(1)}`).join("")}Z` : "";
      const steps = (low, high, most) => {
        const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].find((each) => each * power >= rough) * power;
        return Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 }, (_, k) => +((Math.ceil(low / step) + k) * step).toPrecision(6));
      };
      const grid = steps(this.low, this.high, TICKS).map((at) => `<path class="${at ? "grid" : "axis"}" style="fill: none; stroke: var(--${at ? "line" : "ink"})" d="M${left} ${y(at).toFixed(1)}H${width - right}"/><text x="${left - 6}" y="${(y(at) + 4).toFixed(1)}" text-anchor="end">${at}</text>`);
      const times = steps(first, first + span, width < 500 ? 4 : 8).map((at) => `<text x="${(left + (width - left - right) * (at - first) / span).toFixed(1)}" y="${height - bottom + 16}" text-anchor="middle">${at}</text>`);
      const areas = this.areas.map((bands, n) => `<path fill="${this.layers[n].colour}" d="${bands.map(band).join("")}"/>`);
      const lines = this.lines.map(([, looks, values]) => `<path class="${looks}" d="${path(values)}"/>`);
      const alt = this.kind === "predicted" ? "Measured power, and predicted power stacked by cause" : "Measured minus predicted power, stacked by cause";
      this.plot.innerHTML = `<svg viewBox="0 0 ${width} ${height}" role="img" aria-label="${alt}; the list below has the values at the slider">${grid.join("")}${areas.join("")}${lines.join("")}${times.join("")}<text x="${left}" y="${height - 2}">time [s]; power [W]</text><path class="cursor" d="" style="stroke: var(--ink)"/></svg>`;
    }

    at(k) {
      const x = this.x(k).toFixed(1);
      this.plot.querySelector(".cursor")?.setAttribute("d", `M${x} 6V${FINE[this.kind] - 34}`);
      [...this.lines.map(([, , values]) => values[k]), ...this.layers.map(({ W }) => W[k])].forEach((value, n) => {
        this.values.children[n].lastChild.textContent = Number.isFinite(value) ? `${watts(value)} W` : "-";
      });
    }
  }

  class View {
    // `load`: function that resolves to THREE
    constructor(root, frames, load) {
      Object.assign(this, { root, frames, load, motions: [], k: 0, shows: "predicted", space: null });
      this.reach = Math.max(0.2, reach(frames)) * 0.8;
      this.which = element("select");
      this.button = element("button", { type: "button", textContent: "play" });
      this.slider = element("input", { type: "range", min: 0, max: 0, value: 0, step: 1 });
      this.slider.setAttribute("aria-label", "Time in the recording");
      this.time = element("output");
      this.shown = element("select", {}, new Option("power", "predicted"), new Option("residual", "residual"));
      this.host = element("div", { className: "space", tabIndex: 0 });
      this.host.setAttribute("role", "group");
      this.hint = element("p", { className: "hint" });
      const choose = (share) => this.move(Math.round(Math.min(1, Math.max(0, share)) * (this.motion.t.length - 1)));
      this.courses = [new Course("predicted", "Power by cause", choose), new Course("residual", "Residual by cause", choose)];
      this.pick = element("label", {}, "Recording ", this.which);
      root.replaceChildren(
        element("div", { className: "controls" }, this.pick, element("label", {}, "Joints show the largest cause of the ", this.shown)),
        this.host, this.hint,
        element("div", { className: "controls" }, this.button, element("div", { className: "slide" }, this.slider, this.time)),
        ...this.courses.map(({ node }) => node),
      );
      this.which.onchange = () => this.choose(+this.which.value);
      this.shown.onchange = () => { this.shows = this.shown.value; this.pose(); };
      this.slider.oninput = () => { this.stop(); this.move(+this.slider.value); };
      this.button.onclick = () => this.playing ? this.stop() : this.play();
      addEventListener("resize", () => this.fit());
      this.watch();
    }

    watch() {
      this.name("Posture of the arm");
      const seen = new IntersectionObserver(async ([entry]) => {
        if (!entry.isIntersecting) return;
        seen.disconnect();
        try {
          this.space = new Space(await this.load(), this.host, this.frames, this.reach);
          this.name("The arm in 3D; arrow keys turn the view, + and - change the distance");
          this.hint.textContent = "Drag, or use the arrow keys, to turn the view; + and - change the distance.";
        } catch {
          this.hint.textContent = "This browser shows no 3D graphics (WebGL): the arm is drawn from two sides.";
        }
        this.pose();
      });
      seen.observe(this.host);
    }

    name(words) { this.host.setAttribute("aria-label", words); }

    set(motions) {
      this.motions = motions;
      this.which.replaceChildren(...motions.map(({ name }, n) => new Option(name, n)));
      this.pick.hidden = motions.length < 2;
      this.choose(0);
    }

    choose(n) {
      this.stop();
      this.take(this.motions[n], 0);
    }

    // replaces the motion by one that goes on; a slider at its end follows
    follow(motion) {
      const last = this.motion ? this.motion.t.length - 1 : 0, following = !this.motion || this.k >= last;
      const at = following ? motion.t.length - 1 : Math.max(0, motion.t.findIndex((t) => t >= this.motion.t[this.k]));
      this.pick.hidden = true;
      this.take(motion, at);
    }

    take(motion, k) {
      this.motion = motion;
      this.most = {};
      for (const kind of ["predicted", "residual"]) this.most[kind] = (motion.joints?.[kind]?.W ?? []).flat().reduce((a, b) => Math.max(a, Math.abs(b)), 1e-9);
      this.shown.parentNode.hidden = !motion.joints;
      this.slider.max = motion.t.length - 1;
      this.courses.forEach((course) => { course.node.hidden = !motion[course.kind].length && !(course.kind === "predicted" && motion.measured.some(Number.isFinite)); });
      this.courses.forEach((course) => !course.node.hidden && course.set(motion));
      this.move(k);
    }

    move(k, share = 0) {
      this.k = k;
      this.share = share;
      const { t, measured } = this.motion, now = t[k] + share * ((t[k + 1] ?? t[k]) - t[k]);
      this.slider.value = k;
      this.time.textContent = `${now.toFixed(2)} s`;
      this.courses.forEach((course) => !course.node.hidden && course.at(k));
      const total = this.motion.predicted.reduce((sum, { W }) => sum + W[k], 0);
      this.slider.setAttribute("aria-valuetext", `${now.toFixed(1)} seconds: ${Number.isFinite(measured[k]) ? `measured ${watts(measured[k])} W, ` : ""}predicted ${watts(total)} W`);
      this.pose();
    }

    colours() {
      const joints = this.motion.joints?.[this.shows], layers = this.motion[this.shows];
      if (!joints) return [];
      return (joints.layer[this.k] ?? []).map((n, joint) => {
        const share = NEUTRAL_SHARE + (1 - NEUTRAL_SHARE) * Math.sqrt(Math.abs(joints.W[this.k][joint]) / this.most[this.shows]);
        const [r, g, b] = [1, 3, 5].map((at) => Math.round(parseInt(layers[n].colour.slice(at, at + 2), 16) * share + 184 * (1 - share)));
        return `rgb(${r}, ${g}, ${b})`;
      });
    }

    pose() {
      if (!this.motion) return;
      const q = this.motion.q[this.k], next = this.motion.q[this.k + 1];
      const at = posture(this.frames, next ? q.map((angle, n) => angle + this.share * (next[n] - angle)) : q);
      this.flangeAt = at.points.at(-1);
      if (this.space) this.space.show(at, this.colours());
      else flat(this.host, at, this.colours(), Math.max(0.5, this.reach));
    }

    fit() {
      this.courses.forEach((course) => course.draw());
      this.space?.fit();
      if (this.motion) this.move(this.k, this.share);
    }

    play() {
      const { t } = this.motion;
      if (this.k >= t.length - 1) this.move(0);
      const from = t[this.k], begun = performance.now();
      this.button.textContent = "pause";
      const step = () => {
        const now = from + (performance.now() - begun) / 1000;
        let k = this.k;
        while (k < t.length - 1 && t[k + 1] <= now) k++;
        if (k >= t.length - 1) { this.move(k); this.stop(); return; }
        this.move(k, (now - t[k]) / (t[k + 1] - t[k]));
        this.playing = requestAnimationFrame(step);
      };
      this.playing = requestAnimationFrame(step);
    }

    stop() {
      cancelAnimationFrame(this.playing);
      this.playing = 0;
      this.button.textContent = "play";
    }
  }

  // three.js within the page: base64 of gzip
  async function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    document.head.append(element("script", { textContent: await new Response(stream).text() }));
    return THREE;
  }

  function embedded(figure) {
    const { frames, motions } = JSON.parse(figure.querySelector("script").textContent);
    const view = new View(figure.querySelector(".arm"), frames, () => unpacked(document.getElementById("three").textContent));
    view.set(motions);
    return view;
  }

  return { View, posture, reach, embedded };
})();
