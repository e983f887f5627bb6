"use strict";
(() => {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const toggle = document.getElementById("theme");
  const status = document.getElementById("status");
  const plots = [...document.querySelectorAll(".plot")];

  const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";

  // plotly does not use the style sheet, so every change of theme sets its colours.
  function colours(plot) {
    const style = getComputedStyle(root);
    const text = style.getPropertyValue("--text").trim();
    const line = style.getPropertyValue("--line").trim();
    const back = style.getPropertyValue("--field").trim();
    const changes = { "font.color": text, "hoverlabel.bgcolor": back, "hoverlabel.font.color": text };
    for (const axis of Object.keys(plot.layout ?? {}).filter((key) => /^[xy]axis\d*$/.test(key))) {
      Object.assign(changes, { [`${axis}.gridcolor`]: line, [`${axis}.linecolor`]: line,
        [`${axis}.zerolinecolor`]: line });
    }
    return changes;
  }

  function paint() {
    toggle.setAttribute("aria-pressed", String(isDark()));
    return Promise.all(plots.map((plot) => Plotly.relayout(plot, colours(plot))));
  }

  let selected = null;
  function select(number) {
    selected = number === selected ? null : number;
    for (const button of document.querySelectorAll("button[data-press]")) {
      const chosen = Number(button.dataset.press) === selected;
      button.setAttribute("aria-pressed", String(chosen));
      button.closest("tr").classList.toggle("selected", chosen);
    }
    for (const about of document.querySelectorAll("details[data-press]")) {
      if (Number(about.dataset.press) === selected) about.open = true;
    }
    const drawn = plots.some((plot) => plot.data.some((trace) => trace.meta === selected));
    for (const plot of plots) {
      const own = plot.data.map((trace, index) => [trace, index]).filter(([t]) => t.meta);
      if (!own.length) continue;
      const chosen = ([trace]) => trace.meta === selected;
      Plotly.restyle(plot, {
        opacity: own.map((one) => (!drawn ? 0.6 : chosen(one) ? 1 : 0.1)),
        "line.width": own.map((one) => (drawn && chosen(one) ? 2.5 : 1)),
      }, own.map(([, index]) => index));
    }
    if (selected === null) status.textContent = "all presses shown equally";
    else status.textContent = `press ${selected} is ${drawn ? "highlighted" : "not drawn"}`;
  }

  // Returns the limits of an axis that show all values between two places of x.
  function reach(plot, name, low, high) {
    let least = Infinity, most = -Infinity;
    for (const trace of plot._fullData) {
      if ((trace.yaxis ?? "y").replace("y", "yaxis") !== name || trace.visible !== true) continue;
      for (let i = 0; i < trace.x.length; i++) {
        if (trace.x[i] < low || trace.x[i] > high) continue;
        least = Math.min(least, trace.y[i]);
        most = Math.max(most, trace.y[i]);
      }
    }
    const margin = 0.05 * (most - least) || 1e-6;
    return least <= most ? [least - margin, most + margin] : null;
  }

  // The buttons zoom from the keyboard; dragging with the mouse zooms as well.
  function zoom(button) {
    const plot = document.getElementById(button.dataset.plot);
    const x = Object.keys(plot.layout).filter((key) => /^xaxis\d*$/.test(key)).sort().at(-1);
    let range = button.dataset.range ? JSON.parse(button.dataset.range) : null;
    if (button.dataset.by) {
      const [low, high] = plot._fullLayout[x].range;
      const middle = (low + high) / 2 + (high - low) * Number(button.dataset.shift);
      const half = ((high - low) / 2) * Number(button.dataset.by);
      range = [middle - half, middle + half];
    }
    const changes = range ? { [`${x}.range`]: range } : { [`${x}.autorange`]: true };
    for (const y of Object.keys(plot.layout).filter((key) => /^yaxis\d*$/.test(key))) {
      const found = range && reach(plot, y, ...range);
      changes[found ? `${y}.range` : `${y}.autorange`] = found || true;
    }
    status.textContent = `the plot shows: ${button.textContent}`;
    return Plotly.relayout(plot, changes);
  }

  // On a narrow page the tool bar would cover the legend; the buttons above do the same.
  const wide = matchMedia("(min-width: 52rem)");
  const drawn = plots.map((plot) => {
    const figure = JSON.parse(document.getElementById(`${plot.id}-data`).textContent);
    return Plotly.newPlot(plot, figure.data, figure.layout, { responsive: true, displaylogo: false,
      displayModeBar: wide.matches && "hover",
      toImageButtonOptions: { format: "svg", filename: plot.id } }).then(() => {
      plot.on("plotly_click", (event) => {
        const point = event.points[0];
        const number = plot.id === "over-session" ? point.x : point.data.meta;
        if (number && number !== selected) select(number);
      });
    });
  });
  const first = document.querySelector("button[data-range]");
  Promise.all(drawn).then(paint).then(() => first && zoom(first)).then(() => {
    status.textContent = "";
    root.dataset.ready = "yes";
  });

  toggle.addEventListener("click", () => { root.dataset.theme = isDark() ? "light" : "dark"; paint(); });
  system.addEventListener("change", paint);
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (button?.dataset.press) select(Number(button.dataset.press));
    if (button?.dataset.plot) zoom(button);
  });
  // The slow motion: every attribute of every part has one value per frame.
  const slider = document.getElementById("frame");
  const play = document.getElementById("play");
  const motion = { parts: [], playing: 0 };

  function put(frame) {
    slider.value = frame;
    for (const [part, name, values] of motion.parts) {
      if (name) part.setAttribute(name, values[frame]);
      else part.textContent = values[frame];
    }
  }

  function stop() {
    clearInterval(motion.playing);
    motion.playing = 0;
    play.textContent = "Play";
  }

  function start() {
    if (slider.value === slider.max) put(0);
    const pause = matchMedia("(prefers-reduced-motion: reduce)").matches ? 400 : 40;
    motion.playing = setInterval(() => {
      if (slider.value === slider.max) stop();
      else put(Number(slider.value) + 1);
    }, pause);
    play.textContent = "Pause";
  }

  if (slider) {
    const moves = JSON.parse(document.getElementById("slow-motion-data").textContent);
    for (const [id, attributes] of Object.entries(moves)) {
      const part = document.getElementById(id);
      for (const [name, values] of Object.entries(attributes)) motion.parts.push([part, name, values]);
    }
    play.parentElement.hidden = false;
    play.addEventListener("click", () => (motion.playing ? stop() : start()));
    slider.addEventListener("input", () => { stop(); put(Number(slider.value)); });
  }

  let before = null, shown = null;
  addEventListener("beforeprint", () => {
    before = root.dataset.theme ?? "";
    root.dataset.theme = "light";
    for (const about of document.querySelectorAll("details")) about.open = true;
    if (slider) {
      stop();
      shown = slider.value;
      put(Number(slider.defaultValue));
    }
    paint();
  });
  addEventListener("afterprint", () => {
    if (before) root.dataset.theme = before;
    else delete root.dataset.theme;
    if (slider) put(Number(shown));
    paint();
  });
})();
