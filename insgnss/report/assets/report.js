/* Draws the charts of a page of insgnss and makes its table of images searchable.

   The data are in the page: <script id="charts"> holds what insgnss/report/charts/encoded.py wrote,
   <script id="images"> (where there are images) what insgnss/report/image_table.py wrote. uPlot draws axes,
   cursor and selection; everything inside the axes, and the maps, are painted here. Texts of others
   (names of images) only ever become text nodes. */
(() => {
  "use strict";

  // ---------------------------------------------------------------- data

  const root = document.documentElement;
  const json = (id) => JSON.parse(document.getElementById(id)?.textContent ?? "null");
  const page = json("charts");
  const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const arrays = page.arrays.map((given) => {
    if (typeof given === "string") return new Float32Array(bytesOf(given));
    const steps = new Uint16Array(bytesOf(given.steps));
    return Float32Array.from(steps, (k) => (k === 65535 ? NaN : given.low + k * given.step));
  });
  const NONE = new Float32Array(0);
  for (const chart of page.charts) {
    for (const panel of chart.panels) {
      for (const layer of panel.layers) {
        for (const name of ["x", "y", "x2", "y2", "value"]) {
          layer[name] = layer[name] === undefined ? null : arrays[layer[name]];
        }
        layer.y ??= NONE;
        layer.ink ??= "first";
        layer.texts = layer.texts === undefined ? [] : page.texts[layer.texts];
      }
    }
  }
  const images = imageTable(json("images"));
  const track = trackOf(json("track"));

  /** Where the flight was at which minute. */
  function trackOf(given) {
    if (!given) return null;
    const [t, x, y] = [given.minutes, given.east, given.north].map((text) => new Float32Array(bytesOf(text)));
    return { t, x, y };
  }

  /** Columns of whole numbers in steps, each value or its difference from the one before. */
  function imageTable(given) {
    if (!given) return null;
    const kinds = { 1: Int8Array, 2: Int16Array, 4: Int32Array };
    const pad = (n) => String(n).padStart(2, "0");
    for (const column of given.columns.filter((one) => one.of === undefined)) {
      const steps = new kinds[column.bytes](bytesOf(column.steps));
      let sum = 0;
      column.values = Float64Array.from(steps, (step) => {
        sum = column.differences ? sum + step : step;
        return (column.offset ?? 0) + sum * 10 ** -column.digits;
      });
      column.text = (row) => (column.dash !== undefined && column.values[row] === column.dash
        ? "–" : column.values[row].toFixed(column.digits));
    }
    const column = (key) => given.columns.find((one) => one.key === key).values;
    for (const clock of given.columns.filter((one) => one.of !== undefined)) {
      clock.values = column(clock.of);
      clock.text = (row) => {
        const s = Math.floor(clock.values[row] + clock.clock + 5e-4) % 86400;
        return [s / 3600, s / 60 % 60, s % 60].map((x) => pad(Math.floor(x))).join(":");
      };
    }
    const names = given.names.map((name) => given.prefix + name + given.suffix);
    const flags = new Uint16Array(bytesOf(given.flags));
    const start = given.start;
    return { ...given, names, flags, column, count: names.length,
      minutes: Float64Array.from(column("time"), (t) => (t - start) / 60) };
  }

  /** Place of the value nearest to x in an ascending array. */
  function nearest(values, x) {
    let low = 0, high = values.length - 1;
    if (high < 0) return -1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (values[middle] < x) low = middle; else high = middle;
    }
    return Math.abs(values[low] - x) <= Math.abs(values[high] - x) ? low : high;
  }

  // ---------------------------------------------------------------- ink

  const dark = matchMedia("(prefers-color-scheme: dark)");
  let inks = {};
  const ink = (role) => (inks[role] ??= getComputedStyle(root).getPropertyValue(`--${role}`).trim());
  const inkOf = (layer) => ink(`ink-${layer.ink}`);
  const VIRIDIS = [[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142],
    [31, 158, 137], [53, 183, 121], [110, 206, 88], [181, 222, 43], [253, 231, 37]];

  const darkest = () => (dark.matches && !root.classList.contains("printing") ? 3 : 0); // seen on the paper there is

  function viridis(share) {
    const at = darkest() + Math.max(0, Math.min(1, share || 0)) * (VIRIDIS.length - 1 - darkest());
    const k = Math.min(Math.floor(at), VIRIDIS.length - 2);
    const mixed = VIRIDIS[k].map((a, i) => Math.round(a + (VIRIDIS[k + 1][i] - a) * (at - k)));
    return `rgb(${mixed})`;
  }

  /** What a scale of colours spans: all, but no more than twice what 95 % of the values reach. */
  function colours(layer) {
    if (layer.span) return layer.span;
    const sorted = layer.value.filter(Number.isFinite).sort();
    const low = sorted[0] ?? 0;
    const most = sorted[sorted.length - 1] ?? 1;
    const high = Math.min(most, 2 * (sorted[Math.floor(0.95 * (sorted.length - 1))] ?? 1));
    layer.span = { low, high: high > low ? high : low + Math.max(0.2 * Math.abs(low), 1e-9),
      more: most > high };
    return layer.span;
  }

  /** A number as one reads it: four digits, no more. */
  function short(value) {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    if (size === 0) return "0";
    if (size < 1e-3 || size >= 1e6) return value.toExponential(2);
    const digits = size >= 1000 ? 0 : size >= 100 ? 1 : size >= 1 ? 2 : size >= 0.1 ? 3 : 4;
    return value.toFixed(digits);
  }

  function make(tag, className, text) {
    const element = document.createElement(tag);
    if (className) element.className = className;
    if (text !== undefined) element.textContent = text;
    return element;
  }

  // ---------------------------------------------------------------- painting of layers

  /** Returns where a value lies between two ends, on a linear or logarithmic scale. */
  function scaled(low, high, log, from, to) {
    if (!log) {
      const slope = (to - from) / (high - low || 1);
      return (value) => from + (value - low) * slope;
    }
    const first = Math.log10(low);
    const slope = (to - from) / (Math.log10(high) - first || 1);
    return (value) => (value > 0 ? from + (Math.log10(value) - first) * slope
      : from - 4 * (to - from));
  }

  const PAINT = {
    line(g, l, X, Y, s) {
      g.beginPath();
      let drawn = false;
      for (let i = 0; i < l.x.length; i++) {
        const y = l.y[i];
        if (!Number.isFinite(y)) { drawn = false; continue; }
        if (drawn) g.lineTo(X(l.x[i]), Y(y)); else g.moveTo(X(l.x[i]), Y(y));
        drawn = true;
      }
      g.lineWidth = (l.width || 1.4) * s;
      g.stroke();
    },
    band(g, l, X, Y) {
      g.globalAlpha *= 0.16;
      for (let i = 0; i < l.x.length;) {
        if (!Number.isFinite(l.y[i] + l.y2[i])) { i++; continue; }
        let end = i;
        while (end < l.x.length && Number.isFinite(l.y[end] + l.y2[end])) end++;
        g.beginPath();
        for (let k = i; k < end; k++) g.lineTo(X(l.x[k]), Y(l.y[k]));
        for (let k = end - 1; k >= i; k--) g.lineTo(X(l.x[k]), Y(l.y2[k]));
        g.fill();
        i = end;
      }
    },
    points(g, l, X, Y, s, box) {
      const r = (l.width ? l.width / 2 : l.x.length > 3000 ? 1.2 : l.value ? 3 : 2.2) * s;
      const span = l.value ? colours(l) : null;
      g.lineWidth = 1.4 * s;
      for (let i = 0; i < l.x.length; i++) {
        const x = X(l.x[i]);
        let y = Y(l.y[i]);
        if (box.edge) y = Math.max(box.top + r, Math.min(box.bottom - r, y));
        if (!(x > box.left - 9 && x < box.right + 9 && y > box.top - 9 && y < box.bottom + 9)) continue;
        if (span) g.fillStyle = g.strokeStyle = viridis((l.value[i] - span.low) / (span.high - span.low));
        mark(g, l.mark ?? "dot", x, y, r);
      }
    },
    steps(g, l, X, Y, s, box) {
      g.beginPath();
      g.moveTo(X(l.x[0]), box.bottom);
      for (let i = 0; i < l.y.length; i++) {
        g.lineTo(X(l.x[i]), Y(l.y[i]));
        g.lineTo(X(l.x[i + 1]), Y(l.y[i]));
      }
      g.lineTo(X(l.x[l.x.length - 1]), box.bottom);
      g.save();
      g.globalAlpha *= 0.35;
      g.fill();
      g.restore();
    },
    arrows(g, l, X, Y, s) {
      g.lineWidth = (l.width || 1.2) * s;
      for (let i = 0; i < l.x.length; i++) {
        const x = X(l.x[i]), y = Y(l.y[i]), x2 = X(l.x2[i]), y2 = Y(l.y2[i]);
        const angle = Math.atan2(y2 - y, x2 - x), head = Math.min(5 * s, Math.hypot(x2 - x, y2 - y));
        g.beginPath();
        g.moveTo(x, y);
        g.lineTo(x2, y2);
        for (const side of [2.6, -2.6]) {
          g.moveTo(x2, y2);
          g.lineTo(x2 + head * Math.cos(angle + side), y2 + head * Math.sin(angle + side));
        }
        g.stroke();
      }
    },
    rules(g, l, X, Y, s, box) {
      g.lineWidth = (l.width || 1) * s;
      g.beginPath();
      for (const value of l.y.length ? l.y : l.x) {
        const at = l.y.length ? Y(value) : X(value);
        if (l.y.length) { g.moveTo(box.left, at); g.lineTo(box.right, at); }
        else { g.moveTo(at, box.top); g.lineTo(at, box.bottom); }
      }
      g.stroke();
    },
    labels(g, l, X, Y, s, box) {
      texts(g, Array.from(l.x, (x, i) => [l.texts[i], X(x), Y(l.y[i])]), s, box, ink("shade-line"));
    },
  };

  function mark(g, kind, x, y, r) {
    g.beginPath();
    if (kind === "cross") {
      g.moveTo(x - r, y - r); g.lineTo(x + r, y + r);
      g.moveTo(x - r, y + r); g.lineTo(x + r, y - r);
      g.stroke();
    } else if (kind === "ring") {
      g.arc(x, y, 1.6 * r, 0, 7);
      g.stroke();
    } else {
      if (kind === "square") g.rect(x - r, y - r, 2 * r, 2 * r);
      else if (kind === "triangle") {
        g.moveTo(x, y - 1.3 * r); g.lineTo(x + 1.2 * r, y + r); g.lineTo(x - 1.2 * r, y + r);
      } else g.arc(x, y, r, 0, 7);
      g.fill();
    }
  }

  /** Writes texts where they collide with none written before. */
  function texts(g, wanted, s, box, paper) {
    const taken = (box.taken ??= []);
    g.font = `${11.5 * s}px system-ui, sans-serif`;
    g.textAlign = "center";
    g.textBaseline = "middle";
    for (const [text, x, y] of wanted) {
      const half = g.measureText(text).width / 2 + 3 * s, tall = 8 * s;
      if (!(x - half > box.left && x + half < box.right && y - tall > box.top && y + tall < box.bottom)) continue;
      if (taken.some((b) => Math.abs(b.x - x) < b.half + half && Math.abs(b.y - y) < b.tall + tall)) continue;
      taken.push({ x, y, half, tall });
      if (paper) {
        g.fillStyle = paper;
        g.fillRect(x - half, y - tall, 2 * half, 2 * tall);
      }
      g.fillStyle = ink("ink");
      g.fillText(text, x, y);
    }
  }

  function paint(g, layers, hidden, X, Y, s, box) {
    for (const layer of layers) {
      if (layer.name && hidden.has(layer.name)) continue;
      g.save();
      g.strokeStyle = g.fillStyle = inkOf(layer);
      g.globalAlpha = layer.faint ? 0.45 : 1;
      g.lineJoin = "round";
      if (layer.dashed) g.setLineDash([6 * s, 4 * s]);
      PAINT[layer.kind](g, layer, X, Y, s, box);
      g.restore();
    }
  }

  // ---------------------------------------------------------------- links: zoom, cursor, image

  const views = []; // everything that shows an instant or an image: point(where), chosen(image)
  const groups = new Map(); // charts whose horizontal axes move together

  function groupOf(key) {
    if (!groups.has(key)) groups.set(key, { panels: [], full: [Infinity, -Infinity], home: null, range: null });
    return groups.get(key);
  }

  /** Shows the same instant and image everywhere; null for none. */
  function point(where, from) {
    for (const view of views) if (view !== from) view.point?.(where);
  }

  const ofImage = (image) => ({ image, time: images ? images.minutes[image] : null });

  function ofTime(time) {
    if (!images || !images.count) return { time, image: null };
    const image = nearest(images.minutes, time);
    return { time, image: Math.abs(images.minutes[image] - time) <= images.near ? image : null };
  }

  /** An image that was clicked stays marked, in the table too. */
  function choose(image, from) {
    for (const view of views) view.chosen?.(image, view === from);
  }

  // ---------------------------------------------------------------- charts with axes

  class Panel {
    constructor(view, axes, number, box) {
      Object.assign(this, { view, axes, number });
      const chart = view.chart;
      this.log = axes.scale === "log";
      this.logX = chart.scale === "log";
      this.link = chart.link ?? "";
      this.group = view.groups[number];
      this.group.panels.push(this);
      this.y = axes.limits ?? null;
      this.box = box;
      this.named = (chart.shades ?? []).filter((shade) => shade.text);
      this.head = make("div", "keys");
      this.head.append(make("b", "", axes.label));
      const named = axes.layers.filter((layer, k) => layer.name
        && axes.layers.findIndex((other) => other.name === layer.name) === k);
      this.keys = named.map((layer) => this.key(layer));
      for (const layer of axes.layers) if (layer.value) this.head.append(bar(layer));
      this.element = make("div", "panel");
      this.element.append(this.head, make("div", "axes"));
    }

    /** An entry of the legend: hides what it names, shows its value under the cursor. */
    key(layer) {
      const button = make("button", this.view.hidden.has(layer.name) ? "off" : "");
      button.type = "button";
      const sign = signOf(layer);
      const value = make("span", "value");
      button.append(sign, document.createTextNode(layer.name), value);
      button.addEventListener("click", () => this.view.toggle(layer.name));
      this.head.append(button);
      return { layer, button, sign, value };
    }

    draw(width, height) {
      const self = this, last = this.number >= this.view.chart.panels.length - 1 || this.view.columns > 1;
      const k = this.k = root.classList.contains("printing") ? 2 : 1; // paper: twice as fine, shown at half its size
      const axis = { stroke: () => ink("soft"), font: `${12 * k}px system-ui, sans-serif`,
        grid: { stroke: () => ink("grid"), width: k }, ticks: { stroke: () => ink("rule"), size: 4 * k, width: k } };
      const above = this.number === 0 && this.named.length ? 18 : 6;
      this.plot?.destroy();
      this.plot = new uPlot({
        width: width * k, height: (height + (last ? 24 : 0)) * k, legend: { show: false },
        padding: [above, 10, last ? 0 : 6, 0].map((size) => size * k),
        cursor: { y: false, points: { show: false }, bind: { dblclick: () => null },
          drag: { x: true, y: true, uni: 24, setScale: false } },
        scales: {
          x: { time: false, distr: this.logX ? 3 : 1, range: () => self.group.range },
          y: { distr: this.log ? 3 : 1, range: () => self.rangeY() },
        },
        axes: [
          { ...axis, size: last ? 24 * k : 0, gap: 2 * k, space: 70 * k, values: last ? ticks : () => [],
            ...(this.logX ? ofLog : {}), ...(last ? {} : { ticks: { show: false } }) },
          { ...axis, size: (width < 500 ? 46 : 60) * k, gap: 3 * k, space: 32 * k, values: ticks,
            ...(this.log ? ofLog : {}) },
        ],
        series: [{}, { paths: () => null, points: { show: false } }],
        hooks: {
          drawClear: [(u) => self.shades(u)],
          draw: [(u) => self.paint(u)],
          setSelect: [(u) => self.selected(u)],
        },
      }, [this.group.range.slice(), this.log ? [1, 10] : [0, 1]], this.element.lastChild);
      this.signs();
      this.listen(this.plot.over);
    }

    signs() {
      for (const { layer, sign } of this.keys) {
        sign.style.color = layer.value ? viridis(0.4) : inkOf(layer);
        sign.style.opacity = layer.faint ? 0.45 : "";
      }
    }

    box4(u) {
      const { left, top, width, height } = u.bbox;
      return { left, top, right: left + width, bottom: top + height };
    }

    transform(u) {
      const b = this.box4(u), { x, y } = u.scales;
      return [scaled(x.min, x.max, this.logX, b.left, b.right), scaled(y.min, y.max, this.log, b.bottom, b.top), b];
    }

    shades(u) {
      const [X, , b] = this.transform(u), g = u.ctx;
      g.save();
      for (const { begin, end, kind } of this.view.chart.shades ?? []) {
        const left = Math.max(X(begin), b.left), right = Math.min(X(end), b.right);
        if (right < b.left || left > b.right) continue;
        g.fillStyle = ink(`shade-${kind}`);
        g.fillRect(left, b.top, Math.max(right - left, 2), b.bottom - b.top);
      }
      g.restore();
    }

    paint(u) {
      const [X, Y, b] = this.transform(u), g = u.ctx, s = uPlot.pxRatio * this.k;
      g.save();
      g.beginPath();
      g.rect(b.left, b.top, b.right - b.left, b.bottom - b.top);
      g.clip();
      b.edge = this.axes.limits && same(this.y, this.axes.limits); // what lies beyond stands at the edge
      paint(g, this.axes.layers, this.view.hidden, X, Y, s, b);
      g.restore();
      if (this.number === 0 && this.named.length) { // the numbers of the lines, above the axes
        const above = { left: b.left - 2, right: b.right + 12 * s, top: -99, bottom: b.top + 99 };
        texts(g, this.named.map((shade) => [shade.text, (X(shade.begin) + X(shade.end)) / 2, b.top - 8 * s]), s, above);
      }
    }

    /** The vertical range: what was asked for, else all that is drawn in the horizontal one. */
    rangeY() {
      if (this.y) return this.y;
      const [from, to] = this.group.range;
      let low = Infinity, high = -Infinity;
      const take = (y) => {
        if (Number.isFinite(y) && !(this.log && y <= 0)) { low = Math.min(low, y); high = Math.max(high, y); }
      };
      for (const layer of this.axes.layers) {
        if (layer.name && this.view.hidden.has(layer.name)) continue;
        if (layer.kind === "steps") take(this.log ? NaN : 0);
        for (const values of [layer.y, layer.y2]) {
          if (!values) continue;
          const always = layer.kind === "rules";
          for (let i = 0; i < values.length; i++) {
            if (always || (layer.x[i] >= from && layer.x[i] <= to)) take(values[i]);
          }
        }
      }
      if (!(high >= low)) return this.log ? [1, 10] : [0, 1];
      if (this.log) return high > low ? [low / 1.3, high * 1.3] : [low / 2, high * 2];
      const pad = high > low ? 0.06 * (high - low) : Math.max(Math.abs(low) * 0.1, 1e-3);
      return [low - (low === 0 && this.axes.layers[0].kind === "steps" ? 0 : pad), high + pad];
    }

    listen(over) {
      const at = (event) => this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
      over.addEventListener("mousemove", (event) => {
        if (event.buttons) return;
        const x = at(event);
        const where = this.link === "time" ? ofTime(x)
          : this.link === "image" && images ? ofImage(Math.max(0, Math.min(images.count - 1, Math.round(x) - 1)))
            : {};
        this.values(x);
        for (const panel of this.group.panels) if (panel !== this) panel.cursor(x);
        point({ ...where, skip: this.group }, this);
      });
      over.addEventListener("mouseleave", () => { this.values(null); point({}); });
      over.addEventListener("click", (event) => {
        const where = this.link === "time" ? ofTime(at(event)) : {};
        if (where.image !== null && where.image !== undefined && !this.dragged) choose(where.image, this);
        this.dragged = false;
      });
      over.addEventListener("dblclick", () => this.home());
      over.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && !event.shiftKey) return; // the page scrolls
        event.preventDefault();
        const factor = Math.exp(0.0025 * (event.deltaY || event.deltaX) * (event.deltaMode ? 20 : 1));
        if (event.shiftKey) {
          const y = this.plot.posToVal(event.clientY - over.getBoundingClientRect().top, "y");
          this.y = zoomed([this.plot.scales.y.min, this.plot.scales.y.max], y, factor, this.log);
          this.refresh();
        } else zoom(this.group, zoomed(this.group.range, at(event), factor, this.logX));
      }, { passive: false });
      this.pinch(over);
    }

    /** Two fingers zoom and move the horizontal axis. */
    pinch(over) {
      let before = null;
      const measure = (event) => Array.from(event.touches, (touch) => touch.clientX - over.getBoundingClientRect().left);
      over.addEventListener("touchmove", (event) => {
        if (event.touches.length === 1) {
          const x = this.plot.posToVal(measure(event)[0], "x");
          this.values(x);
          point(this.link === "time" ? ofTime(x) : {}, this);
        }
        if (event.touches.length !== 2) { before = null; return; }
        event.preventDefault();
        const [a, b] = measure(event).sort((p, q) => p - q);
        if (before && b - a > 20) {
          const X = (pixel) => this.plot.posToVal(pixel, "x");
          const factor = (before[1] - before[0]) / (b - a), middle = X((before[0] + before[1]) / 2);
          zoom(this.group, zoomed(this.group.range, middle, factor, this.logX));
        }
        before = [a, b];
      }, { passive: false });
      over.addEventListener("touchend", () => { before = null; });
    }

    /** A rectangle was drawn: its width, its height or both become the axes. */
    selected(u) {
      const { left, top, width, height } = u.select;
      if (width < 4 && height < 4) return;
      this.dragged = true;
      const wide = width >= 4 && width < u.over.clientWidth - 1;
      const x = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
      if (height >= 4 && height < u.over.clientHeight - 1) {
        this.y = [u.posToVal(top + height, "y"), u.posToVal(top, "y")];
      }
      u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      if (wide) zoom(this.group, x); else this.refresh();
    }

    /** Double click: back to what was shown at first; a second one shows everything. */
    home() {
      const first = this.axes.limits ?? null;
      const atHome = same(this.group.range, this.group.home) && same(this.y, first);
      for (const panel of this.group.panels) panel.y = atHome ? null : panel.axes.limits ?? null;
      zoom(this.group, (atHome ? this.group.full : this.group.home).slice());
    }

    refresh() { this.plot?.setData(this.plot.data); }

    /** Shows the values at x in the legend and beside the axis; none for null. */
    values(x) {
      for (const { layer, value } of this.keys) {
        let text = "";
        const alone = this.axes.layers.filter((other) => other.name === layer.name).length === 1;
        if (alone && x !== null && (layer.kind === "line" || layer.kind === "points") && layer.x.length) {
          const i = nearest(layer.x, x);
          const far = Math.abs(layer.x[i] - x) > 0.02 * (this.group.range[1] - this.group.range[0]);
          if (!far) text = layer.texts[i] ?? short(layer.y[i]);
        }
        value.textContent = text;
      }
      this.view.reading(x);
    }

    cursor(x) {
      if (!this.plot) return;
      const left = x === null || x === undefined || !Number.isFinite(x) ? -10 : this.plot.valToPos(x, "x");
      const inside = left >= 0 && left <= this.plot.over.clientWidth;
      this.plot.setCursor({ left: inside ? left : -10, top: inside ? 1 : -10 }, false);
      this.values(inside ? x : null);
    }

    point({ time, image, skip }) {
      if (skip === this.group) return;
      if (this.link === "time") this.cursor(time ?? null);
      else if (this.link === "image") this.cursor(image === null || image === undefined ? null : image + 1);
      else this.cursor(null);
    }

    chosen(image) { if (this.link) this.point(ofImage(image)); }
  }

  const same = (a, b) => (a === b) || (a && b && Math.abs(a[0] - b[0]) + Math.abs(a[1] - b[1]) < 1e-9 * Math.abs(b[1] - b[0]));
  const ticks = (u, splits) => splits.map((value) => (value === null ? "" : `${+value.toPrecision(6)}`));

  function logSplits(u, axis, low, high) {
    const decades = Math.log10(high / low);
    const steps = decades > 6 ? [1] : decades > 2.5 ? [1, 3] : decades > 0.7 ? [1, 2, 5] : [1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9];
    const found = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) {
      for (const step of steps) {
        const value = step * 10 ** power;
        if (value >= low && value <= high) found.push(value);
      }
    }
    return found;
  }

  const ofLog = { splits: logSplits, filter: (u, splits) => splits };

  function zoomed([low, high], about, factor, log) {
    if (log) return [low, high].map((end) => about * (end / about) ** factor);
    return [low, high].map((end) => about + (end - about) * factor);
  }

  /** Sets the horizontal range of all charts of a group, within what there is to show. */
  function zoom(group, [low, high]) {
    const [first, last] = group.full;
    const range = [Math.max(low, first), Math.min(high, last)];
    if (!(range[1] - range[0] > 1e-7 * (last - first))) return;
    group.range = range;
    for (const panel of group.panels) panel.refresh();
  }

  /** What stands for a layer in a legend: its mark, a piece of its line, or its area. */
  function signOf(layer) {
    const mark = layer.kind === "points" && { cross: "×", ring: "○", square: "■", triangle: "▲" }[layer.mark];
    if (mark) return make("i", "mark", mark);
    return make("i", { points: "dot", band: "area", steps: "area" }[layer.kind] ?? "");
  }

  const strips = [];

  function inkStrips() {
    const scale = VIRIDIS.slice(darkest()).map((c) => `rgb(${c})`);
    for (const strip of strips) strip.style.background = `linear-gradient(90deg, ${scale})`;
  }

  /** A bar of colours with the numbers at its ends. */
  function bar(layer) {
    const { low, high, more } = colours(layer);
    const strip = make("span", "bar");
    strips.push(strip);
    inkStrips();
    const scale = make("span", "scale");
    scale.append(`${layer.value_name ?? ""} ${short(low)}`, strip, `${more ? "≥ " : ""}${short(high)}`);
    return scale;
  }

  class AxesView {
    constructor(chart, figure) {
      Object.assign(this, { chart, figure, hidden: new Set() });
      this.columns = chart.columns ?? 1;
      const width = (key) => groupOf(key);
      this.groups = chart.panels.map((_, k) => width(chart.link || (this.columns > 1 ? `${chart.name} ${k}` : chart.name)));
      chart.panels.forEach((panel, k) => this.extend(this.groups[k], panel));
      this.body = figure.querySelector(".plot");
      this.body.style.minHeight = `${this.height() * Math.ceil(chart.panels.length / this.columns) + 60}px`;
    }

    /** The group's range holds all that this panel draws. */
    extend(group, panel) {
      const log = this.chart.scale === "log";
      for (const layer of panel.layers) {
        if (layer.kind === "rules" && layer.y.length) continue;
        for (const x of layer.x) {
          if (Number.isFinite(x) && !(log && x <= 0)) {
            group.full[0] = Math.min(group.full[0], x);
            group.full[1] = Math.max(group.full[1], x);
          }
        }
      }
      group.home ??= this.chart.limits ?? null;
      group.log = log;
      group.dotted ||= this.chart.link !== "time" && panel.layers.some((layer) => layer.kind === "points");
    }

    height() {
      const rows = Math.ceil(this.chart.panels.length / this.columns);
      return rows === 1 ? 250 : rows === 2 ? 190 : rows === 3 ? 160 : 130;
    }

    draw(width) {
      width ??= this.body.clientWidth;
      this.width = width;
      const columns = width < 560 ? 1 : this.columns;
      if (!this.panels) {
        this.grid = make("div", "panels");
        this.panels = this.chart.panels.map((axes, k) => new Panel(this, axes, k));
        this.grid.append(...this.panels.map((panel) => panel.element));
        this.across = make("div", "across", this.chart.label);
        this.body.append(this.shadeKeys(), this.grid, this.across);
        views.push(...this.panels);
      }
      this.grid.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
      const each = Math.floor((width - 14 * (columns - 1)) / columns);
      for (const panel of this.panels) panel.draw(each, this.height());
      this.body.style.minHeight = "";
    }

    shadeKeys() {
      const names = { line: "flight line", rest: "stationary", outage: "no used fix", other: "no solution" };
      const keys = make("div", "keys");
      for (const kind of new Set((this.chart.shades ?? []).map((shade) => shade.kind))) {
        const sign = make("i", "area");
        sign.style.cssText = `background: var(--shade-${kind}); opacity: 1`;
        const entry = make("span", "shade");
        entry.append(sign, document.createTextNode(` ${names[kind]}`));
        keys.append(entry);
      }
      if (!keys.childElementCount) keys.hidden = true;
      return keys;
    }

    toggle(name) {
      if (!this.hidden.delete(name)) this.hidden.add(name);
      for (const panel of this.panels) {
        for (const { layer, button } of panel.keys) button.classList.toggle("off", this.hidden.has(layer.name));
        panel.refresh();
      }
    }

    reading(x) {
      let at = x === null || x === undefined ? "" : `: ${short(x)}`;
      if (at && this.chart.link === "image" && images) {
        const image = Math.max(0, Math.min(images.count - 1, Math.round(x) - 1));
        at = `: ${image + 1}, ${images.names[image]}`;
      }
      this.across.textContent = this.chart.label + at;
    }

    ink() { for (const panel of this.panels ?? []) { panel.signs(); panel.plot?.redraw(false, true); } }
  }

  // ---------------------------------------------------------------- maps

  const MARGIN = { left: 62, right: 12, top: 10, bottom: 34 };
  const GROUND_ALPHA = 0.6; // of the ground below: lines and dots stand out

  class MapView {
    constructor(chart, figure) {
      Object.assign(this, { chart, figure, hidden: new Set(), layers: chart.panels[0].layers, image: null, passed: null, fixed: null });
      this.body = figure.querySelector(".plot");
      this.body.style.minHeight = "480px";
      this.shots = images && chart.link === "image"
        ? this.layers.find((layer) => layer.kind === "points" && layer.x.length === images.count && layer.value) : null;
      this.track = chart.link ? track : null;
    }

    build() {
      this.keys = make("div", "keys");
      this.entries = this.layers.filter((layer) => layer.name).map((layer) => {
        const button = make("button"), sign = signOf(layer);
        button.type = "button";
        button.append(sign, document.createTextNode(layer.name));
        button.addEventListener("click", () => {
          if (!this.hidden.delete(layer.name)) this.hidden.add(layer.name);
          button.classList.toggle("off", this.hidden.has(layer.name));
          this.paint();
        });
        this.keys.append(button);
        return { layer, sign };
      });
      for (const layer of this.layers) if (layer.value) this.keys.append(bar(layer));
      if (this.chart.background) {
        this.ground = new Image();
        this.ground.onload = () => this.paint();
        this.ground.src = `data:image/jpeg;base64,${this.chart.background.jpeg}`;
      }
      this.frame = make("div", "map");
      this.canvas = make("canvas");
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("role", "img");
      this.canvas.setAttribute("aria-label", this.chart.title);
      this.tip = make("div", "tip");
      this.tip.hidden = true;
      const tools = make("div", "tools");
      for (const [text, title, act] of [["+", "zoom in", () => this.zoom(1.6)], ["−", "zoom out", () => this.zoom(1 / 1.6)],
        ["all", "show everything", () => { this.fit(); this.paint(); }]]) {
        const button = make("button", "", text);
        button.type = "button";
        button.title = title;
        button.addEventListener("click", act);
        tools.append(button);
      }
      this.frame.append(this.canvas, this.tip);
      this.body.append(tools, this.keys, this.frame);
      this.listen();
      views.push(this);
      this.fitted = false;
    }

    draw(width) {
      if (!this.frame) this.build();
      width ??= this.body.clientWidth - 2;
      this.width = width;
      const before = this.wide;
      this.wide = width;
      this.high = Math.round(Math.max(320, Math.min(0.6 * width, 560)));
      this.ratio = Math.max(devicePixelRatio, root.classList.contains("printing") ? 2 : 1);
      this.canvas.width = Math.round(this.wide * this.ratio);
      this.canvas.height = Math.round(this.high * this.ratio);
      this.canvas.style.height = `${this.high}px`;
      this.canvas.style.width = `${this.wide}px`;
      if (!this.fitted || before !== width) this.fit();
      this.ink();
      this.body.style.minHeight = "";
    }

    ink() {
      for (const { layer, sign } of this.entries ?? []) sign.style.color = layer.value ? viridis(0.4) : inkOf(layer);
      if (this.frame) this.paint();
    }

    /** Shows everything: pixels per metre, and what lies in the middle. */
    fit() {
      const ends = [[Infinity, -Infinity], [Infinity, -Infinity]];
      for (const layer of this.layers) {
        [[layer.x, layer.x2], [layer.y, layer.y2]].forEach((pair, axis) => {
          for (const values of pair) {
            for (const value of values ?? []) {
              if (Number.isFinite(value)) { ends[axis][0] = Math.min(ends[axis][0], value); ends[axis][1] = Math.max(ends[axis][1], value); }
            }
          }
        });
      }
      const wide = this.wide - MARGIN.left - MARGIN.right, high = this.high - MARGIN.top - MARGIN.bottom;
      const reach = ends.map(([low, high2]) => Math.max(high2 - low, 1e-3));
      this.scale = 0.92 * Math.min(wide / reach[0], high / reach[1]);
      this.least = 0.2 * this.scale;
      this.middle = ends.map(([low, high2]) => (low + high2) / 2);
      this.fitted = true;
    }

    X(east) { return MARGIN.left + (this.wide - MARGIN.left - MARGIN.right) / 2 + (east - this.middle[0]) * this.scale; }

    Y(north) { return MARGIN.top + (this.high - MARGIN.top - MARGIN.bottom) / 2 - (north - this.middle[1]) * this.scale; }

    paint() {
      const g = this.canvas.getContext("2d"), s = this.ratio;
      const box = { left: MARGIN.left, right: this.wide - MARGIN.right, top: MARGIN.top, bottom: this.high - MARGIN.bottom };
      g.setTransform(s, 0, 0, s, 0, 0);
      g.fillStyle = ink("paper");
      g.fillRect(0, 0, this.wide, this.high);
      this.grid(g, box);
      g.save();
      g.beginPath();
      g.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
      g.clip();
      if (this.ground?.complete && this.ground.naturalWidth) {
        const { west, south, east, north } = this.chart.background;
        g.globalAlpha = GROUND_ALPHA;
        g.drawImage(this.ground, this.X(west), this.Y(north), (east - west) * this.scale, (north - south) * this.scale);
        g.globalAlpha = 1;
      }
      paint(g, this.layers, this.hidden, (x) => this.X(x), (y) => this.Y(y), 1, box);
      this.names(g, box);
      this.marks(g);
      g.restore();
    }

    grid(g, box) {
      const step = niceStep(80 / this.scale);
      g.font = "11.5px system-ui, sans-serif";
      g.lineWidth = 1;
      const ends = [[box.left, box.right], [box.bottom, box.top]];
      for (const axis of [0, 1]) {
        const value = (pixel) => this.middle[axis] + (axis ? -1 : 1) * (pixel - (axis ? this.Y(this.middle[1]) : this.X(this.middle[0]))) / this.scale;
        const [low, high] = ends[axis].map(value);
        for (let k = Math.ceil(low / step); k * step <= high; k++) {
          const at = Math.round(axis ? this.Y(k * step) : this.X(k * step)) + 0.5;
          g.strokeStyle = ink("grid");
          g.beginPath();
          if (axis) { g.moveTo(box.left, at); g.lineTo(box.right, at); } else { g.moveTo(at, box.top); g.lineTo(at, box.bottom); }
          g.stroke();
          g.fillStyle = ink("soft");
          g.textAlign = axis ? "right" : "center";
          g.textBaseline = axis ? "middle" : "top";
          g.fillText(`${+(k * step).toPrecision(8)}`, axis ? box.left - 5 : at, axis ? at : box.bottom + 4);
        }
      }
      g.textAlign = "center";
      g.textBaseline = "top";
      g.fillText(this.chart.label, (box.left + box.right) / 2, box.bottom + 18);
      g.save();
      g.translate(4, (box.top + box.bottom) / 2);
      g.rotate(-Math.PI / 2);
      g.fillText(this.chart.panels[0].label, 0, 0);
      g.restore();
    }

    /** Names of images, where so few are in sight that they can be read. */
    names(g, box) {
      if (!this.shots) return;
      const seen = [];
      for (let i = 0; i < images.count && seen.length <= 60; i++) {
        const x = this.X(this.shots.x[i]), y = this.Y(this.shots.y[i]);
        if (x > box.left && x < box.right && y > box.top && y < box.bottom) seen.push([images.names[i], x, y - 13]);
      }
      if (seen.length <= 60 && seen.length < 0.7 * images.count + 1) texts(g, seen, 1, box);
    }

    marks(g) {
      const ring = (x, y, radius, colour) => {
        g.beginPath();
        g.arc(x, y, radius, 0, 7);
        g.lineWidth = 2.4;
        g.strokeStyle = colour;
        g.stroke();
      };
      if (this.instant) ring(this.X(this.instant[0]), this.Y(this.instant[1]), 4, ink("ink-second"));
      for (const image of [this.fixed, this.image]) {
        if (image !== null && this.shots) ring(this.X(this.shots.x[image]), this.Y(this.shots.y[image]), image === this.fixed ? 9 : 7, ink("ink"));
      }
    }

    /** The point nearest to a pixel that has something to say. */
    hit(x, y, reach = 14) {
      let best = null, least = reach * reach;
      for (const layer of this.layers) {
        if (layer.kind !== "points" && layer.kind !== "arrows") continue;
        if (layer.name && this.hidden.has(layer.name)) continue;
        const bonus = layer === this.shots ? 0.25 : 1; // images before fixes
        for (let i = 0; i < layer.x.length; i++) {
          const d = bonus * ((this.X(layer.x[i]) - x) ** 2 + (this.Y(layer.y[i]) - y) ** 2);
          if (d < least) { least = d; best = { layer, i }; }
        }
      }
      return best;
    }

    /** The row of the flight's track nearest to a pixel; null where none is near. */
    along(x, y) {
      let best = null, least = 10 * 10;
      for (let i = 0; i < (this.track?.t.length ?? 0); i++) {
        const d = (this.X(this.track.x[i]) - x) ** 2 + (this.Y(this.track.y[i]) - y) ** 2;
        if (d < least) { least = d; best = i; }
      }
      return best;
    }

    say(found, x, y) {
      if (!found) { this.tip.hidden = true; return; }
      const { layer, i } = found;
      const text = found.text ?? (layer === this.shots ? images.columns.filter((column) => column.tip).reduce(
        (lines, column) => `${lines}\n${column.tip}: ${column.text(i)}${column.unit ? ` ${column.unit}` : ""}`,
        `${images.names[i]}${flagsOf(i) ? `\n${flagsOf(i)}` : ""}`)
        : layer.texts[i] ?? [layer.name, layer.value ? `${layer.value_name}: ${short(layer.value[i])}` : ""].filter(Boolean).join("\n"));
      if (!text) { this.tip.hidden = true; return; }
      this.tip.textContent = text;
      this.tip.hidden = false;
      const wide = this.tip.offsetWidth, high = this.tip.offsetHeight;
      this.tip.style.left = `${Math.max(2, x + 14 + wide > this.wide ? x - wide - 14 : x + 14)}px`;
      this.tip.style.top = `${Math.max(2, Math.min(y + 14, this.high - high - 2))}px`;
    }

    listen() {
      const canvas = this.canvas, touches = new Map();
      let moved = 0;
      const at = (event) => { const r = canvas.getBoundingClientRect(); return [event.clientX - r.left, event.clientY - r.top]; };
      canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        touches.set(event.pointerId, at(event));
        moved = 0;
      });
      canvas.addEventListener("pointermove", (event) => {
        const [x, y] = at(event);
        if (!touches.has(event.pointerId)) { this.hover(x, y); return; }
        const before = touches.get(event.pointerId);
        moved += Math.abs(x - before[0]) + Math.abs(y - before[1]);
        if (touches.size === 2) {
          const other = [...touches].find(([id]) => id !== event.pointerId)[1];
          const length = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
          if (length(before) > 10) this.zoom(length([x, y]) / length(before), [(x + other[0]) / 2, (y + other[1]) / 2]);
        } else if (moved > 3) {
          this.middle = [this.middle[0] - (x - before[0]) / this.scale, this.middle[1] + (y - before[1]) / this.scale];
          this.say(null);
          this.paint();
        }
        touches.set(event.pointerId, [x, y]);
      });
      const up = (event) => {
        const [x, y] = at(event);
        if (touches.delete(event.pointerId) && moved <= 3 && event.type === "pointerup") {
          this.hover(x, y);
          if (this.image !== null) choose(this.image, this);
        }
      };
      canvas.addEventListener("pointerup", up);
      canvas.addEventListener("pointercancel", up);
      canvas.addEventListener("pointerleave", () => { this.image = this.passed = this.instant = null; this.say(null); this.paint(); point({}, this); });
      canvas.addEventListener("dblclick", () => { this.fit(); this.paint(); });
      canvas.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && !event.shiftKey) return; // the page scrolls
        event.preventDefault();
        this.zoom(Math.exp(-0.0016 * (event.deltaY || event.deltaX) * (event.deltaMode ? 20 : 1)), at(event));
      }, { passive: false });
      canvas.addEventListener("keydown", (event) => {
        const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
        if (move) this.middle = this.middle.map((value, k) => value + move[k] * 60 / this.scale);
        else if (event.key === "+") this.zoom(1.6);
        else if (event.key === "-") this.zoom(1 / 1.6);
        else return;
        event.preventDefault();
        this.paint();
      });
    }

    hover(x, y) {
      const found = this.hit(x, y);
      this.say(found, x, y);
      const image = found && found.layer === this.shots ? found.i : null;
      const k = image === null ? this.along(x, y) : null; // beside images, the flight itself
      if (image === this.image && k === this.passed) return;
      this.image = image;
      this.passed = k;
      this.instant = k === null ? null : [this.track.x[k], this.track.y[k]];
      if (k !== null && !found) this.say({ text: `minute ${this.track.t[k].toFixed(2)}` }, x, y);
      this.paint();
      point(image !== null ? ofImage(image) : k !== null ? { time: this.track.t[k], image: null } : {}, this);
    }

    zoom(factor, about = [this.wide / 2, this.high / 2]) {
      const scale = Math.max(this.least, Math.min(this.scale * factor, 5000 * this.least));
      const centre = [this.X(this.middle[0]), this.Y(this.middle[1])];
      const shift = 1 / this.scale - 1 / scale;
      this.middle = [this.middle[0] + (about[0] - centre[0]) * shift, this.middle[1] - (about[1] - centre[1]) * shift];
      this.scale = scale;
      this.paint();
    }

    point({ time, image }) {
      this.image = image ?? null;
      this.instant = null;
      if (this.track && Number.isFinite(time) && this.track.t.length) {
        const k = nearest(this.track.t, time);
        this.instant = [this.track.x[k], this.track.y[k]];
      }
      this.paint();
    }

    chosen(image) {
      if (!this.shots) return;
      this.fixed = image;
      const x = this.X(this.shots.x[image]), y = this.Y(this.shots.y[image]);
      if (x < MARGIN.left || x > this.wide - MARGIN.right || y < MARGIN.top || y > this.high - MARGIN.bottom) {
        this.middle = [this.shots.x[image], this.shots.y[image]];
      }
      this.paint();
    }
  }

  function niceStep(least) {
    const power = 10 ** Math.floor(Math.log10(least));
    return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= least);
  }

  // ---------------------------------------------------------------- the table of images

  const flagsOf = (row) => images.flag_names.filter((_, bit) => images.flags[row] & (1 << bit)).join(", ");
  const PRINTED = 500; // rows

  class Table {
    constructor(host) {
      this.host = host;
      this.order = { key: null, down: false };
      this.fixed = null;
      this.controls();
      this.frame = make("div", "listed");
      this.frame.tabIndex = 0;
      const table = make("table"), head = make("thead"), top = make("tr");
      this.columns = [
        { head: "no.", number: true, value: (row) => row + 1, text: (row) => `${row + 1}` },
        { head: "image", value: (row) => images.names[row], text: (row) => images.names[row] },
        ...images.columns.map((column) => ({ head: column.head, title: column.title, number: true,
          value: (row) => column.values[row], text: column.text })),
        { head: "flags", value: flagsOf, text: flagsOf },
      ];
      this.columns.forEach((column, k) => {
        const cell = make("th", column.number ? "number" : "", column.head);
        cell.tabIndex = 0;
        if (column.title) cell.title = column.title;
        cell.addEventListener("click", () => this.sort(k));
        cell.addEventListener("keydown", (event) => { if (event.key === "Enter") this.sort(k); });
        column.cell = cell;
        top.append(cell);
      });
      this.tbody = make("tbody");
      head.append(top);
      table.append(head, this.tbody);
      this.frame.append(table);
      this.foot = make("p", "soft");
      host.append(this.bar, this.frame, this.foot);
      this.frame.addEventListener("scroll", () => this.fill());
      this.tbody.addEventListener("click", (event) => {
        const row = event.target.closest("tr[data-image]");
        if (row) choose(+row.dataset.image, this);
      });
      this.tbody.addEventListener("mouseover", (event) => {
        const row = event.target.closest("tr[data-image]");
        point(row ? ofImage(+row.dataset.image) : {}, this);
      });
      this.tbody.addEventListener("mouseleave", () => point({}, this));
      views.push(this);
      this.filter();
    }

    controls() {
      this.bar = make("div", "controls");
      this.search = make("input");
      this.search.type = "search";
      this.search.placeholder = "search name or flag";
      this.search.setAttribute("aria-label", "search images");
      this.flag = make("select");
      this.flag.setAttribute("aria-label", "which images");
      const option = (value, text) => { const o = make("option", "", text); o.value = value; this.flag.append(o); };
      option("", `all ${images.count} images`);
      images.flag_names.forEach((name, bit) => {
        const count = images.flags.reduce((sum, flags) => sum + ((flags >> bit) & 1), 0);
        if (count) option(`flag ${bit}`, `${name} (${count})`);
      });
      const lines = images.column("line");
      for (const line of [...new Set(lines)].sort((a, b) => a - b)) if (line > 0) option(`line ${line}`, `line ${line}`);
      this.copy = make("button", "copy", "copy as CSV");
      this.copy.type = "button";
      this.count = make("span", "soft");
      this.bar.append(this.search, this.flag, this.copy, this.count);
      this.search.addEventListener("input", () => this.filter());
      this.flag.addEventListener("change", () => this.filter());
      this.copy.addEventListener("click", () => this.copyCsv());
    }

    filter() {
      const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
      const [kind, number] = this.flag.value.split(" ");
      const line = images.column("line");
      this.rows = [];
      for (let row = 0; row < images.count; row++) {
        if (kind === "flag" && !(images.flags[row] & (1 << +number))) continue;
        if (kind === "line" && line[row] !== +number) continue;
        if (words.length) {
          const text = `${images.names[row]} ${flagsOf(row)}`.toLowerCase();
          if (!words.every((word) => text.includes(word))) continue;
        }
        this.rows.push(row);
      }
      this.arrange();
    }

    sort(k) {
      this.order = { key: k, down: this.order.key === k ? !this.order.down : this.columns[k].number && k > 0 };
      this.arrange();
    }

    arrange() {
      const { key, down } = this.order;
      if (key !== null) {
        const value = this.columns[key].value, sign = down ? -1 : 1;
        const numeric = this.columns[key].number;
        const compare = new Intl.Collator("en", { numeric: true }).compare;
        this.rows.sort((a, b) => sign * (numeric ? value(a) - value(b) : compare(value(a), value(b))) || a - b);
        this.columns.forEach((column, at) => {
          column.cell.textContent = column.head + (at === key ? (down ? " ▾" : " ▴") : "");
          column.cell.setAttribute("aria-sort", at !== key ? "none" : down ? "descending" : "ascending");
        });
      }
      this.count.textContent = `${this.rows.length} of ${images.count}`;
      this.fill();
    }

    /** Makes the rows in sight, between two spaces as high as all the others. */
    fill() {
      const high = this.rowHeight ?? 26, sight = this.frame.clientHeight || 400;
      const printing = root.classList.contains("printing");
      const first = printing ? 0 : Math.max(0, Math.floor(this.frame.scrollTop / high) - 10);
      const last = printing ? Math.min(this.rows.length, PRINTED)
        : Math.min(this.rows.length, first + Math.ceil(sight / high) + 20);
      const space = (rows) => {
        const tr = make("tr", "space"), td = make("td");
        td.colSpan = this.columns.length;
        td.style.height = `${rows * high}px`;
        tr.append(td);
        return tr;
      };
      this.tbody.replaceChildren(
        ...(first ? [space(first)] : []),
        ...this.rows.slice(first, last).map((row) => this.row(row)),
        ...(!printing && last < this.rows.length ? [space(this.rows.length - last)] : []));
      this.foot.textContent = !this.rows.length ? "No image matches." : printing && last < this.rows.length
        ? `The first ${last} of ${this.rows.length} rows; report.html and the exports hold all of them.` : "";
      if (!this.rowHeight && last > first) this.rowHeight = this.tbody.querySelector("tr[data-image]").offsetHeight || undefined;
    }

    row(image) {
      const tr = make("tr", image === this.fixed || image === this.image ? "here" : "");
      tr.dataset.image = image;
      for (const column of this.columns) tr.append(make("td", column.number ? "number" : "", column.text(image)));
      return tr;
    }

    csv() {
      /* a name that a spreadsheet would take for a formula stands behind an apostrophe, which it hides */
      const plain = (text) => (/^[=+@\t\r]|^-(?!\d*\.?\d+$)/.test(text) ? `'${text}` : text);
      const cell = (text) => (/[",\r\n]/.test(plain(text)) ? `"${plain(text).replaceAll('"', '""')}"` : plain(text));
      const line = (cells) => cells.map(cell).join(",");
      return `${[line(this.columns.map((column) => column.head)),
        ...this.rows.map((row) => line(this.columns.map((column) => column.text(row))))].join("\n")}\n`;
    }

    async copyCsv() {
      const text = this.csv();
      let done = false;
      try { await navigator.clipboard.writeText(text); done = true; } catch { /* no clipboard here: the old way */ }
      if (!done) {
        const area = make("textarea");
        area.value = text;
        document.body.append(area);
        area.select();
        done = document.execCommand("copy");
        area.remove();
      }
      this.copy.textContent = done ? `copied ${this.rows.length} rows` : "copying is not allowed here";
      setTimeout(() => { this.copy.textContent = "copy as CSV"; }, 2500);
    }

    mark() {
      for (const tr of this.tbody.querySelectorAll("tr[data-image]")) {
        tr.classList.toggle("here", +tr.dataset.image === this.fixed || +tr.dataset.image === this.image);
      }
    }

    point({ image }) { this.image = image ?? null; this.mark(); }

    chosen(image, own) {
      this.fixed = image;
      if (!own) {
        if (!this.rows.includes(image)) { this.search.value = this.flag.value = ""; this.filter(); }
        this.frame.scrollTop = Math.max(0, (this.rowHeight ?? 26) * (this.rows.indexOf(image) - 4));
        this.fill();
      }
      this.mark();
    }
  }

  // ---------------------------------------------------------------- the page

  const shown = page.charts.flatMap((chart) => {
    const figure = document.getElementById(chart.name);
    return figure ? [new (chart.map ? MapView : AxesView)(chart, figure)] : [];
  });
  for (const group of groups.values()) {
    if (!(group.full[1] > group.full[0])) group.full = Number.isFinite(group.full[0]) ? [group.full[0] - 1, group.full[0] + 1] : [0, 1];
    if (group.dotted) group.full = zoomed(group.full, group.log ? Math.sqrt(group.full[0] * group.full[1])
      : (group.full[0] + group.full[1]) / 2, 1.03, group.log); // no point is cut by the edge
    group.home ??= group.full;
    group.range = group.home.slice();
  }
  const host = document.getElementById("image-table");
  if (images && host) new Table(host);

  const inSight = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      inSight.unobserve(target);
      shown.find((view) => view.figure === target).draw();
    }
  }, { rootMargin: "400px" });
  for (const view of shown) inSight.observe(view.figure);

  let waiting = 0;
  addEventListener("resize", () => {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(() => {
      for (const view of shown) {
        const width = view.body.clientWidth - (view instanceof MapView ? 2 : 0);
        if (view.width !== undefined && width > 0 && view.width !== width) view.draw(); // of no width: taken as a picture
      }
    });
  });

  function reink() {
    inks = {};
    inkStrips();
    for (const view of shown) view.ink?.();
  }
  dark.addEventListener("change", reink);

  const PAPER = 690; // pixels between the margins of A4
  const folded = [...document.querySelectorAll("details")];
  addEventListener("beforeprint", () => {
    root.classList.add("printing");
    inks = {};
    for (const details of folded) { details.dataset.open = details.open; details.open = true; }
    for (const view of shown) { inSight.unobserve(view.figure); view.draw(PAPER); }
    for (const view of views) if (view instanceof Table) view.fill();
  });
  addEventListener("afterprint", () => {
    root.classList.remove("printing");
    inks = {};
    for (const details of folded) details.open = details.dataset.open === "true";
    for (const view of shown) view.draw();
    for (const view of views) if (view instanceof Table) view.fill();
  });

  /* The heading that one reads stands out in the list of contents. */
  const links = [...document.querySelectorAll("nav.contents a")];
  const targets = links.map((link) => document.getElementById(decodeURIComponent(link.hash.slice(1))));
  const follow = () => {
    let here = 0;
    targets.forEach((target, k) => { if (target && target.getBoundingClientRect().top < 120) here = k; });
    links.forEach((link, k) => link.classList.toggle("here", k === here));
  };
  addEventListener("scroll", follow, { passive: true });
  if (links.length) follow();

  /* For tests: what is shown, and what is drawn where. */
  window.insgnssReport = { shown, groups, images, views, point, choose };
})();
