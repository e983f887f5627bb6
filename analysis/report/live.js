"use strict";
(() => {
  const LONGEST = 40000;  // points of a trace that are kept; a longer press loses its beginning
  const find = (id) => document.getElementById(id);
  const traces = new Map();
  const state = { arm: "not connected", daq: "-", press: null, made: 0, dropped: 0, ended: false };

  function say() {
    const press = state.press === null ? "" : `, press ${state.press}`;
    const lost = state.dropped ? `, ${state.dropped} events not shown` : "";
    find("state").textContent = state.ended ? `The session has ended, ${state.made} made; \`sautereau report\` writes the page of all.`
      : state.watched ? `watching; ${state.made} made`
      : `arm ${state.arm}, acquisition ${state.daq}${press}, ${state.made} made${lost}`;
  }

  // Each column of the canvas shows the range of its samples.
  function draw(trace) {
    const { canvas, caption, label, values } = trace;
    const ratio = devicePixelRatio || 1;
    const wide = canvas.width = Math.round(canvas.clientWidth * ratio);
    const high = canvas.height = Math.round(canvas.clientHeight * ratio);
    const pen = canvas.getContext("2d");
    let low = Infinity, top = -Infinity;
    for (const value of values) {
      if (value === null) continue;
      low = Math.min(low, value);
      top = Math.max(top, value);
    }
    caption.textContent = low > top ? `${label}: nothing`
      : `${label}: ${low.toPrecision(4)} to ${top.toPrecision(4)}`;
    pen.strokeStyle = getComputedStyle(canvas).color;
    pen.lineWidth = 1.5 * ratio;
    pen.beginPath();
    const span = top - low || 1, edge = 2 * ratio;
    values.forEach((value, index) => {
      if (value === null) return;
      pen.lineTo((index / Math.max(1, values.length - 1)) * wide,
        high - edge - ((value - low) / span) * (high - 2 * edge));
    });
    pen.stroke();
  }

  function trace(label) {
    if (!traces.has(label)) {
      const figure = document.createElement("figure");
      const caption = document.createElement("figcaption");
      const canvas = document.createElement("canvas");
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `${label} over time`);
      figure.className = "live";
      figure.append(caption, canvas);
      find("traces").append(figure);
      traces.set(label, { canvas, caption, label, values: [] });
    }
    return traces.get(label);
  }

  function clear() {
    for (const one of traces.values()) one.values = [];
  }

  const take = {
    stage(event) {
      if (event.press !== null && event.press !== state.press) clear();
      Object.assign(state, { arm: event.arm, daq: event.daq, press: event.press ?? state.press });
    },
    samples(event) {
      find("traces").parentElement.hidden = false;
      if (event.press !== state.press) clear();
      state.press = event.press;
      for (const [label, values] of event.traces) {
        const one = trace(label);
        one.values.push(...values);
        if (one.values.length > LONGEST) one.values = one.values.slice(-LONGEST);
        draw(one);
      }
    },
    made(event) { Object.assign(state, event); },
    fault(event) {
      const item = document.createElement("li");
      item.textContent = event.text;
      const list = find("faults").querySelector("ul");
      list.append(item);
      while (list.children.length > 20) list.firstChild.remove();
      find("faults").hidden = false;
    },
    report(event) {  // replaces the last one when it has loaded: the session may end before
      for (const one of document.querySelectorAll("iframe.waiting")) one.remove();
      const next = find("report").cloneNode();
      next.id = "";
      next.className = "waiting";
      next.hidden = false;
      next.src = `/report?${event.version}`;
      next.addEventListener("load", () => {
        const body = next.contentDocument?.body;
        if (!body) return next.remove();
        find("report").remove();
        next.id = "report";
        next.className = "";
        find("shown").textContent = event.text;
        const fit = () => { next.style.height = `${body.offsetHeight + 2}px`; };
        new next.contentWindow.ResizeObserver(fit).observe(body);
      });
      find("report").after(next);
    },
  };

  const repaint = () => { for (const one of traces.values()) draw(one); };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  addEventListener("resize", repaint);

  const source = new EventSource("/events");
  source.onmessage = (message) => {
    const event = JSON.parse(message.data);
    take[event.kind]?.(event);
    say();
  };
  source.onopen = () => {  // the server begins with what has happened so far
    find("faults").querySelector("ul").replaceChildren();
    find("faults").hidden = true;
    clear();
    state.ended = false;
    say();
  };
  source.onerror = () => { state.ended = true; say(); };
})();
