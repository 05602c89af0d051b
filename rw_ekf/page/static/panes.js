// One run on the page: its rows, what is drawn of them, and which stretch of time is seen.
"use strict";

const RPM = 60 / (2 * Math.PI);
const MOST_ROWS = 12000; // kept in each table; older rows are thinned to half when there are more
const SILENT_MS = 25000; // the server says at least each 15 s that it is still there
const CHI_95 = 3.841; // of one degree of freedom
const UNITS = { motor_gain: "rad/s²/A", viscous: "1/s", coulomb: "rad/s²", static: "rad/s²" };
// What a motion must have before a number may be relied on, however small its sigma is (docs/filter.md#what-may-be-relied-on)
const MOTION = {
  motor_gain: "the motion has to show it at two unlike currents", viscous: "the motion has to show it at two unlike speeds",
  coulomb: "the motion has to show it at two unlike speeds, and two currents or a coast", static: "the motion has to show a stop or a reversal",
};
const NAMES = { motor_gain: "motor gain", viscous: "viscous", coulomb: "Coulomb", static: "static" };

function token() { return new URLSearchParams(location.hash.slice(1)).get("token") || ""; }

async function ask(path, options = {}) {
  const answer = await fetch(path, { ...options, headers: { "x-token": token() } });
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).error || answer.statusText);
  return answer;
}

function colour(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

function clock(s) {
  if (s == null || !isFinite(s)) return "";
  const sign = s < 0 ? "-" : "", t = Math.abs(s), h = Math.floor(t / 3600), m = Math.floor(t / 60) % 60, r = t % 60;
  const two = (n) => String(Math.floor(n)).padStart(2, "0");
  const rest = t < 10 ? r.toFixed(1) : two(r);
  return sign + (h ? `${h}:${two(m)}:${two(r)}` : `${m}:${t < 10 ? rest.padStart(4, "0") : rest}`);
}

function short(value) {
  if (value == null || !isFinite(value)) return "–";
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(2) : Number(value.toPrecision(4)).toString();
}

// Rows by column, in the order in which they came.
class Table {
  constructor() { this.columns = { time_s: [] }; }
  get rows() { return this.columns.time_s.length; }
  add(more) {
    const count = (more.time_s || []).length;
    if (!count) return;
    const before = this.rows;
    for (const name of new Set([...Object.keys(this.columns), ...Object.keys(more)])) {
      if (!this.columns[name]) this.columns[name] = new Array(before).fill(null);
      const values = more[name] || new Array(count).fill(null);
      for (const value of values) this.columns[name].push(value);
    }
    if (this.rows > MOST_ROWS) this.thin();
  }
  thin() {
    const half = Math.floor(this.rows / 2);
    for (const name of Object.keys(this.columns)) {
      this.columns[name] = this.columns[name].filter((_, i) => i >= half || i % 2 === 0);
    }
  }
  column(name) { return this.columns[name] || new Array(this.rows).fill(null); }
  upTo(t) { // how many rows there are until a time
    let low = 0, high = this.rows;
    const time = this.columns.time_s;
    while (low < high) { const middle = (low + high) >> 1; if (time[middle] <= t) low = middle + 1; else high = middle; }
    return low;
  }
}

class Pane {
  constructor(root, run) {
    this.root = root;
    this.run = run;
    this.log = new Table();
    this.estimates = new Table();
    this.events = [];
    this.state = null;
    this.curve = {};
    this.span = 0; // seconds seen; 0: all
    this.end = null; // last time seen; null: now
    this.until = null; // while a run is played: up to when it is known
    this.charts = [];
    this.dirty = true;
    this.source = null;
    this.closed = false;
    this.begin().catch((error) => this.say("gone", String(error.message || error), "bad"));
  }

  q(selector) { return this.root.querySelector(selector); }

  async begin() {
    this.tools();
    await this.load();
    this.follow();
    this.q(".make").addEventListener("click", () => this.report("POST"));
    this.report();
    this.frame = () => { if (this.closed) return; this.step(); if (this.dirty) { this.dirty = false; this.draw(); } setTimeout(() => requestAnimationFrame(this.frame), 100); };
    requestAnimationFrame(this.frame);
  }

  async load() {
    const told = await (await ask(`api/history?run=${encodeURIComponent(this.run)}`)).json();
    this.log = new Table(); this.estimates = new Table();
    this.log.add(told.log); this.estimates.add(told.estimates);
    this.events = told.events;
    this.take(told.state);
    this.build();
    this.listEvents();
    this.loadCurve();
    this.dirty = true;
  }

  async report(method = "GET") { // the diagnosis of this run: a link where there is one, else a button that has it made
    const told = await ask(`api/report?run=${encodeURIComponent(this.run)}`, { method }).then((answer) => answer.json(), (error) => ({ report: "failed", text: error.message }));
    const make = this.q(".make"), link = this.q(".report a");
    make.hidden = !token() || told.report === "working";
    make.textContent = told.report === "ready" ? "Make it anew" : "Make the report";
    link.hidden = told.report !== "ready";
    if (told.link) link.href = told.link;
    this.q(".report span").textContent = { working: "the run is being diagnosed ...", failed: `no report: ${told.text}` }[told.report] || "";
    if (told.report === "working" && !this.closed) setTimeout(() => this.report(), 2000);
  }

  async loadCurve() {
    let top = 10;
    for (const value of this.log.column("speed_rad_s")) if (value != null && Math.abs(value) > top) top = Math.abs(value);
    this.asked = performance.now();
    const believed = encodeURIComponent(JSON.stringify(this.believed()));
    this.curve = await (await ask(`api/curve?run=${encodeURIComponent(this.run)}&top=${1.1 * top}&believed=${believed}`)).json();
    this.dirty = true;
  }

  lastRow() { return this.until == null ? this.estimates.rows - 1 : this.estimates.upTo(this.until + this.zero()) - 1; }

  believed() { // each parameter and effect with its sigma, at what is played or now
    const at = this.lastRow(), found = {};
    for (const name of this.parameters()) {
      const value = known(this.estimates.column(name), at), std = known(this.estimates.column(`std_${name}`), at);
      if (value != null && std != null) found[name] = [value, std];
    }
    return found;
  }

  async follow() { // server-sent events by fetch, for EventSource sends no header
    while (!this.closed) {
      try {
        this.source = new AbortController();
        const answer = await ask(`api/live?run=${encodeURIComponent(this.run)}`, { signal: this.source.signal });
        const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
        let text = "";
        for (;;) {
          const silent = setTimeout(() => this.source.abort(), SILENT_MS);
          const { done, value } = await reader.read().finally(() => clearTimeout(silent));
          if (done) break;
          text += value;
          const parts = text.split("\n\n");
          text = parts.pop();
          for (const part of parts) if (part.startsWith("data: ")) await this.hear(JSON.parse(part.slice(6)));
        }
      } catch (error) {
        if (this.closed) return;
      }
      if (this.closed) return;
      const over = this.state && !this.state.alive;
      if (stopped) this.say("stopped", `${stopped} The page ended with the run.`, "");
      else if (!over) this.say("no answer", "the page's server does not answer; whether the run goes on is not known from here: rw-ekf status --config F", "bad");
      await new Promise((resolve) => setTimeout(resolve, 2000));
    }
  }

  async hear(message) {
    if (message.kind === "rows") {
      this.log.add(message.log); this.estimates.add(message.estimates);
      if (message.events.length) { this.events = [...this.events, ...message.events].slice(-2000); this.listEvents(); }
    } else if (message.kind === "state") this.take(message);
    else if (message.kind === "models") await this.loadCurve();
    else if (message.kind === "curve") { if (this.until == null) this.curve = message; }
    else if (message.kind === "behind") await this.load();
    this.dirty = true;
  }

  close() { this.closed = true; if (this.source) this.source.abort(); for (const chart of this.charts) chart.plot.destroy(); this.root.remove(); }

  say(state, reason, kind) {
    const pill = this.q(".pill");
    if (pill.textContent !== state) pill.textContent = state;
    pill.className = `pill ${kind}`;
    this.q(".reason").textContent = reason;
  }

  take(state) {
    this.state = state;
    if (!state) { this.say("ended", "a run of the past: nothing publishes it now", ""); this.q(".link").textContent = ""; }
    else {
      const after = (Date.parse(state.since_utc) - Date.parse(state.began_utc)) / 1000;
      const start = after >= 0 ? ` (${after.toFixed(1)} s after the run's start)` : "";
      const since = state.since_utc ? ` since ${state.since_utc.slice(11, 19)} UTC${start}` : "";
      const shown = state.stale ? "no news" : state.alive ? state.run_state : state.ended_utc ? "ended" : "dead";
      const kind = state.stale ? "bad" : !state.alive ? (state.ended_utc ? "" : "bad") : state.run_state === "TRACKING" ? "good" : state.run_state === "SAFE" ? "bad" : "warn";
      const last = state.alive && !state.stale ? "" : `last ${state.run_state}: `;
      this.say(shown, `${last}${state.reason || ""}${since}`, kind);
      const link = state.link || {};
      const lost = (link.timeouts || 0) + (link.damaged || 0) + (link.stale || 0);
      this.q(".link").textContent = link.state ? `line: ${link.state}, ${short(link.reply_ms)} ms a reply, ${lost} of ${link.requests || 0} lost, ${link.reconnects || 0} reconnections` : "";
    }
    this.listAlarms(state);
    this.q(".play").hidden = this.q(".speed-label").hidden = Boolean(state && state.alive);
  }

  listAlarms(state) { // those that are on, or were when the run ended; a run that nobody watches has none to tell
    const alarms = state && state.alarms, box = this.q(".alarms");
    const said = JSON.stringify([alarms, Boolean(state && state.alive)]);
    if (box.dataset.said === said) return; // else a screen reader would hear them again each second
    box.dataset.said = said;
    const count = alarms ? alarms.length : 0, when = state && state.alive ? "on" : "on at the end";
    box.classList.toggle("on", count > 0);
    box.querySelector("strong").textContent = !alarms ? "" : count ? `${count} alarm${count > 1 ? "s" : ""} ${when}` : `No alarm ${when}`;
    box.querySelector("ul").replaceChildren(...(alarms || []).map((alarm) => {
      const item = document.createElement("li"), button = document.createElement("button");
      button.type = "button";
      button.textContent = alarm.text;
      if (alarm.since_s != null) button.addEventListener("click", () => this.see(alarm.since_s - 15, alarm.since_s + 15));
      item.append(button);
      return item;
    }));
  }

  // What is drawn ------------------------------------------------------------------------------------------------

  parameters() {
    return Object.keys(this.estimates.columns).filter((name) => `std_${name}` in this.estimates.columns && name !== "speed_rad_s");
  }

  build() {
    for (const chart of this.charts) chart.plot.destroy();
    this.charts = [];
    const [left, right] = this.root.querySelectorAll(".charts");
    left.replaceChildren(); right.replaceChildren();
    const time = (title, unit, series, make, options = {}) => this.chart(left, title, unit, series, make, { time: true, ...options });
    const E = (name) => this.cut(this.estimates, name), L = (name) => this.cut(this.log, name);
    const rpm = (values) => values.map((v) => (v == null ? null : v * RPM));
    const band = (values, stds, k) => [values.map((v, i) => (v == null || stds[i] == null ? null : v + k * stds[i])), values.map((v, i) => (v == null || stds[i] == null ? null : v - k * stds[i]))];
    time("speed, read and believed", "rpm", [dots("read"), line("believed"), ...edges()], () => {
      const speed = rpm(E("speed_rad_s")), read = this.beside(L("time_s"), rpm(L("speed_rad_s")), E("time_s"));
      return [E("time_s"), read, speed, ...band(speed, rpm(E("std_speed_rad_s")), 2)];
    }, { band: [3, 4], last: 2, legend: (d, i) => `${short(d[2][i] ?? d[1][i])} rpm` });
    time("current, commanded and measured", "A", [line("commanded", true), line2("measured")], () => [L("time_s"), L("current_command_A"), L("current_A")], { legend: (d, i) => `${short(d[1][i])} / ${short(d[2][i])} A` });
    if ("compensation_A" in this.estimates.columns) time("under compensation: what was asked for, and what was added", "A", [line("asked for", true), line2("added")], () => {
      const added = E("compensation_A"), issued = this.beside(L("time_s"), L("current_command_A"), E("time_s"));
      return [E("time_s"), issued.map((v, i) => (v == null || added[i] == null ? null : v - added[i])), added]; // what went out is their sum
    }, { level: 0, legend: (d, i) => `${short(d[1][i])} + ${short(d[2][i])} A` });
    time("innovation, with the band that it should keep to", "rpm", [line("innovation"), ...edges()], () => {
      const std = rpm(E("innovation_std_rad_s"));
      return [E("time_s"), rpm(E("innovation_rad_s")), std.map((v) => (v == null ? null : 2 * v)), std.map((v) => (v == null ? null : -2 * v))];
    }, { // a spike leaves the chart, as it would leave nothing to be seen of the band; it is whole among the speeds
      band: [2, 3], legend: (d, i) => `${short(d[1][i])} rpm`,
      range: (low, high, u) => {
        const band = (u.data[2] || []).reduce((most, v) => (v > most ? v : most), 0);
        return band > 0 ? padded(Math.max(low, -4 * band), Math.min(high, 4 * band)) : padded(low, high);
      },
    });
    time("NIS, mean of 30; 1 is what it should be", "", [line("NIS")], () => [E("time_s"), running(E("nis"), 30)], { legend: (d, i) => short(d[1][i]), range: (low, high) => [0, Math.max(2, Math.min(high, 40) * 1.1)], level: 1 });
    this.chart(right, "friction over the speed, as it is being learned", "rad/s²", [line("believed"), ...edges(), faint("at the start")], () => this.frictionData(), { band: [2, 3], x: "rpm", lit: true, summary: atTop, legend: (d, i) => `${short(d[1][i])} rad/s² at ${short(d[0][i])} rpm` });
    this.chart(left, "what the model leaves, over the speed", "sigmas", [{ label: "left", stroke: () => colour("--b"), width: 2, points: { show: true, size: 6 } }, ...edges()], () => this.residualMap(), { band: [2, 3], x: "rpm", level: 0, summary: farthest, legend: (d, i) => `${short(d[1][i])} at ${short(d[0][i])} rpm` });
    for (const name of this.parameters()) {
      this.chart(right, NAMES[name] || name.replaceAll("_", " "), UNITS[name] || "", [line(name), ...edges()], () => {
        const values = E(name);
        return [E("time_s"), values, ...band(values, E(`std_${name}`), 2)];
      }, { time: true, band: [2, 3], height: 110, legend: (d, i) => `${short(d[1][i])} ± ${short((d[2][i] - d[1][i]) / 2)}` });
    }
  }

  chart(parent, title, unit, series, make, options) {
    const box = document.createElement("div");
    box.className = "chart";
    box.tabIndex = 0;
    box.setAttribute("role", "img");
    const head = document.createElement("h3");
    const told = document.createElement("span");
    head.append(`${title}${unit ? ` [${unit}]` : ""}`, told);
    box.append(head);
    parent.append(box);
    const axis = { stroke: () => colour("--faint"), grid: { stroke: () => colour("--rule"), width: 1 }, ticks: { show: false }, font: "12px system-ui" };
    const pane = this;
    const plot = new uPlot({
      width: Math.max(box.clientWidth - 6, 200), height: options.height || 150, padding: [8, 10, 0, 0],
      cursor: { sync: options.time ? { key: `time-${this.run}` } : undefined, drag: { x: Boolean(options.time), y: false, setScale: false } },
      legend: { show: false },
      scales: { x: { time: false }, y: { range: (u, low, high) => (options.range ? options.range(low, high, u) : padded(low, high)) } },
      axes: [{ ...axis, size: 26, ...(options.time ? { splits: (u, i, low, high, step) => round(low, high, step, pane.zero()) } : {}), values: (u, ticks) => ticks.map((t) => (options.time ? clock(t - pane.zero()) : short(t))) }, { ...axis, size: 54, values: (u, ticks) => ticks.map(short) }],
      series: [{}, ...series],
      bands: options.band ? [{ series: options.band, fill: () => colour("--band") }] : [],
      hooks: {
        draw: [(u) => pane.marks(u, options)],
        setSelect: [(u) => { if (options.time && u.select.width > 4) { pane.see(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")); u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false); } }],
        setCursor: [(u) => { const i = u.cursor.idx; told.textContent = i == null ? pane.lastOf(u, options) : options.legend(u.data, i); }],
      },
    }, make(), box);
    if (options.time) {
      plot.over.addEventListener("dblclick", () => this.setSpan(0));
      box.addEventListener("keydown", (event) => this.key(event));
    }
    this.charts.push({ plot, make, options, told, box, title });
  }

  // Rows up to what is played, thinned to what the eye can tell apart.
  cut(table, name) {
    const values = table.column(name);
    return this.until == null ? values : values.slice(0, table.upTo(this.until + this.zero()));
  }

  zero() { return this.estimates.columns.time_s[0] ?? this.log.columns.time_s[0] ?? 0; }

  beside(from, values, to) { // the reading at each estimate's time
    const found = new Array(to.length).fill(null);
    let at = 0;
    for (let i = 0; i < to.length; i++) {
      while (at < from.length && from[at] < to[i] - 1e-6) at++;
      if (at < from.length && Math.abs(from[at] - to[i]) < 0.05) found[i] = values[at];
    }
    return found;
  }

  frictionData() {
    const now = this.curve.now || this.curve.began;
    if (!now) return [[0], [null], [null], [null], [null]];
    const began = this.curve.began || now;
    return [now.speed_rad_s.map((v) => v * RPM), now.friction_rad_s2, now.friction_rad_s2.map((v, i) => v + 2 * now.std_rad_s2[i]), now.friction_rad_s2.map((v, i) => v - 2 * now.std_rad_s2[i]), began.friction_rad_s2];
  }

  residualMap() { // mean of the innovation in its sigmas, in bins of speed, with the band of two standard errors of none
    const speed = this.cut(this.estimates, "speed_rad_s"), off = this.cut(this.estimates, "innovation_rad_s"), std = this.cut(this.estimates, "innovation_std_rad_s");
    let top = 0;
    for (const v of speed) if (v != null && Math.abs(v) > top) top = Math.abs(v);
    const bins = 25, sums = new Array(bins).fill(0), counts = new Array(bins).fill(0);
    let at = null, sigma = null;
    for (let i = 0; i < speed.length; i++) {
      at = speed[i] ?? at; sigma = std[i] || sigma;
      if (at == null || off[i] == null || !sigma) continue;
      const bin = Math.min(bins - 1, Math.floor((at / (top || 1) + 1) * 0.5 * bins));
      sums[bin] += off[i] / sigma; counts[bin]++;
    }
    const x = [], mean = [], high = [], low = [];
    for (let bin = 0; bin < bins; bin++) {
      x.push(((bin + 0.5) / bins * 2 - 1) * top * RPM);
      const known = counts[bin] > 4;
      mean.push(known ? sums[bin] / counts[bin] : null);
      high.push(known ? 2 / Math.sqrt(counts[bin]) : null); low.push(known ? -2 / Math.sqrt(counts[bin]) : null);
    }
    return [x, mean, high, low];
  }

  marks(u, options) {
    const ctx = u.ctx, { left, top, width, height } = u.bbox;
    ctx.save();
    ctx.beginPath(); ctx.rect(left, top, width, height); ctx.clip();
    if (options.level != null) { const y = u.valToPos(options.level, "y", true); ctx.strokeStyle = colour("--good"); ctx.setLineDash([6, 4]); ctx.beginPath(); ctx.moveTo(left, y); ctx.lineTo(left + width, y); ctx.stroke(); ctx.setLineDash([]); }
    if (options.time) {
      for (const event of this.events) {
        if (event.time_s == null || (this.until != null && event.time_s > this.until + this.zero())) continue;
        const x = u.valToPos(event.time_s, "x", true);
        if (x < left || x > left + width) continue;
        ctx.strokeStyle = colour(event.event === "state" ? (event.state === "TRACKING" ? "--good" : "--warn") : "--bad");
        ctx.globalAlpha = 0.6; ctx.beginPath(); ctx.moveTo(x, top); ctx.lineTo(x, top + height); ctx.stroke(); ctx.globalAlpha = 1;
      }
    }
    if (options.lit) { // where the wheel has been
      ctx.fillStyle = colour("--b"); ctx.globalAlpha = 0.25;
      for (const v of this.cut(this.estimates, "speed_rad_s")) if (v != null) ctx.fillRect(u.valToPos(v * RPM, "x", true) - 1, top + height - 10, 2, 10);
      ctx.globalAlpha = 1;
    }
    ctx.restore();
  }

  lastOf(u, options) { // a run writes its belief whole once a second, and what changes in each row
    if (options.summary) return options.summary(u.data);
    const told = u.data[options.last || 1];
    let i = told.length - 1;
    while (i > 0 && told[i] == null) i--;
    return i < 0 ? "" : options.legend(u.data, i);
  }

  window() {
    const time = this.cut(this.estimates, "time_s"), log = this.cut(this.log, "time_s");
    const first = Math.min(time[0] ?? Infinity, log[0] ?? Infinity), last = Math.max(time.at(-1) ?? -Infinity, log.at(-1) ?? -Infinity);
    if (!isFinite(first)) return [0, 1];
    const end = this.end == null ? last : this.end;
    return this.span ? [end - this.span, end] : [first, last > first ? last : first + 1];
  }

  draw() {
    const [from, to] = this.window();
    for (const { plot, make, options, told, box, title } of this.charts) {
      const width = Math.max(box.clientWidth - 6, 200);
      if (Math.abs(plot.width - width) > 1) plot.setSize({ width, height: options.height || 150 });
      plot.setData(make(), !options.time);
      if (options.time) plot.setScale("x", { min: from, max: to });
      if (plot.cursor.idx == null) told.textContent = this.lastOf(plot, options);
      box.setAttribute("aria-label", `${title}: ${told.textContent || "no value yet"}`);
    }
    this.q(".now").textContent = `${clock(from - this.zero())} to ${clock(to - this.zero())} since the start`;
    for (const button of this.root.querySelectorAll("[data-span]")) button.setAttribute("aria-pressed", String(Number(button.dataset.span) === this.span && this.end == null));
    this.table();
  }

  table() {
    const at = this.lastRow();
    const valid = (this.until == null && this.state && this.state.valid) || {};
    const rows = this.parameters().map((name) => {
      const value = known(this.estimates.column(name), at), std = known(this.estimates.column(`std_${name}`), at);
      const first = this.estimates.column(`std_${name}`)[0];
      const sharp = first && std != null && std < 0.5 * first;
      const relied = name in valid ? valid[name] : sharp;
      const vague = std > 0.5 * Math.abs(value) ? "sigma is more than half of the value" : "sigma is hardly smaller than at the start";
      const lacks = sharp && std <= 0.5 * Math.abs(value) && MOTION[name] ? MOTION[name] : vague;
      const told = !(name in valid) && !(first && std != null) ? "–" : relied ? "yes" : `not yet: ${lacks}`;
      return [`${NAMES[name] || name}${UNITS[name] ? ` [${UNITS[name]}]` : ""}`, short(value), short(std), told];
    });
    const body = this.q(".parameters tbody");
    body.replaceChildren(...rows.map((cells) => {
      const row = document.createElement("tr");
      cells.forEach((text, i) => { const cell = document.createElement(i ? "td" : "th"); if (!i) cell.scope = "row"; cell.textContent = text; row.append(cell); });
      return row;
    }));
  }

  listEvents() {
    const shown = this.events.slice(-60).reverse();
    this.q(".events").replaceChildren(...shown.map((event) => {
      const item = document.createElement("li"), button = document.createElement("button"), time = document.createElement("time");
      button.type = "button";
      time.textContent = event.time_s == null ? (event.utc || "").slice(11, 19) : clock(event.time_s - this.zero());
      if (event.utc) time.title = event.utc;
      const what = event.event === "state" ? `${event.state}: ${event.reason || ""}` : `${(event.event || "").replaceAll("_", " ")}${event.text || event.reason ? `: ${event.text || event.reason}` : ""}`;
      button.append(time, " ", what);
      if (event.time_s != null) button.addEventListener("click", () => this.see(event.time_s - 15, event.time_s + 15));
      item.append(button);
      return item;
    }));
  }

  // Which stretch is seen ----------------------------------------------------------------------------------------

  setSpan(span) { this.span = span; this.end = null; this.dirty = true; }

  async see(from, to) {
    this.span = to - from; this.end = to; this.dirty = true;
    const seen = this.estimates.upTo(to) - this.estimates.upTo(from);
    if (seen > 200 || (this.state && this.state.alive)) return;
    const told = await (await ask(`api/history?run=${encodeURIComponent(this.run)}&from=${from}&to=${to}`)).json(); // finer
    for (const [mine, more] of [[this.log, told.log], [this.estimates, told.estimates]]) splice(mine, more, from, to);
    this.dirty = true;
  }

  move(by) { const [from, to] = this.window(); const wide = to - from; this.see(from + by * wide, to + by * wide); }

  zoom(factor) { const [from, to] = this.window(); const middle = 0.5 * (from + to), half = 0.5 * (to - from) * factor; this.see(middle - half, middle + half); }

  key(event) {
    const done = { ArrowLeft: () => this.move(-0.25), ArrowRight: () => this.move(0.25), "+": () => this.zoom(0.5), "-": () => this.zoom(2), Home: () => this.setSpan(0) }[event.key];
    if (done) { done(); event.preventDefault(); }
  }

  tools() {
    for (const button of this.root.querySelectorAll("[data-span]")) button.addEventListener("click", () => this.setSpan(Number(button.dataset.span)));
    this.q(".back").addEventListener("click", () => this.move(-0.25));
    this.q(".forth").addEventListener("click", () => this.move(0.25));
    this.q(".nearer").addEventListener("click", () => this.zoom(0.5));
    this.q(".farther").addEventListener("click", () => this.zoom(2));
    this.q(".play").addEventListener("click", () => this.play());
    window.addEventListener("resize", () => { this.dirty = true; });
  }

  play() {
    this.playing = !this.playing;
    if (this.playing && this.until == null) { this.until = 0; this.setSpan(0); }
    this.stamp = performance.now();
    this.q(".play").textContent = this.playing ? "Pause" : "Play";
  }

  step() {
    if (!this.playing) return;
    const now = performance.now();
    this.until += (now - this.stamp) / 1000 * Number(this.q(".speed").value);
    this.stamp = now;
    if (this.until + this.zero() >= (this.estimates.columns.time_s.at(-1) ?? 0)) { this.until = null; this.playing = false; this.q(".play").textContent = "Play"; }
    if (now - this.asked > 1000 || !this.playing) this.loadCurve().catch(() => {}); // what was believed then; the next second asks again
    this.dirty = true;
  }
}

function splice(table, more, from, to) { // rows of a stretch in place of the thinned ones
  if (!more.time_s || !more.time_s.length) return;
  const first = table.upTo(from - 1e-9), last = table.upTo(to);
  for (const name of Object.keys(table.columns)) {
    const finer = more[name] || new Array(more.time_s.length).fill(null);
    table.columns[name] = [...table.columns[name].slice(0, first), ...finer, ...table.columns[name].slice(last)];
  }
}

function atTop(data) { // of friction: between rest and the fastest, for who cannot see the curve
  const i = Math.round(0.75 * (data[0].length - 1)), value = data[1][i];
  return value == null ? "" : `${short(value)} ± ${short((data[2][i] - value) / 2)} at ${short(data[0][i])} rpm`;
}

function farthest(data) { // of the residual: where it is farthest out of its band
  let at = -1, most = 0;
  data[1].forEach((value, i) => { const out = value == null ? 0 : Math.abs(value) / data[2][i]; if (out > most) { most = out; at = i; } });
  return at < 0 ? "" : `farthest ${short(data[1][at])} at ${short(data[0][at])} rpm`;
}

function known(values, at) { // the last that is, up to a row
  while (at > 0 && values[at] == null) at--;
  return values[at];
}

function running(values, count) {
  const found = new Array(values.length).fill(null);
  let sum = 0, known = 0;
  for (let i = 0; i < values.length; i++) {
    if (values[i] != null) { sum += values[i]; known++; }
    if (i >= count && values[i - count] != null) { sum -= values[i - count]; known--; }
    found[i] = known > 2 ? sum / known : null;
  }
  return found;
}

function round(low, high, step, zero) { // ticks at round times since the start
  const found = [];
  for (let t = Math.ceil((low - zero) / step) * step; t <= high - zero; t += step) found.push(t + zero);
  return found;
}

function padded(low, high) {
  if (low == null || high == null) return [-1, 1];
  const more = 0.08 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - more, high + more];
}

const line = (label, stepped) => ({ label, stroke: () => colour("--a"), width: 1.6, spanGaps: !stepped, points: { show: false }, paths: stepped ? uPlot.paths.stepped({ align: 1 }) : undefined });
const line2 = (label) => ({ label, stroke: () => colour("--b"), width: 1.2, points: { show: false } });
const faint = (label) => ({ label, stroke: () => colour("--faint"), width: 1, dash: [5, 4], points: { show: false } });
const dots = (label) => ({ label, stroke: () => colour("--b"), paths: () => null, points: { show: true, size: 3, fill: () => colour("--b"), stroke: () => colour("--b") } });
const edges = () => [0, 1].map(() => ({ stroke: "rgba(0,0,0,0)", width: 0, spanGaps: true, points: { show: false } }));
