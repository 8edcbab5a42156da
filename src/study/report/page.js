"use strict";
// Viewer: one zoom and pan for all pictures of a scene, two of them overlaid, exposure and curve on
// their floats, values under the cursor. Tables that can be sorted.
document.body.classList.remove("without-script");

const LARGEST_ZOOM = 32;

// Decodes base 64 to halves, and those to floats, by a table of all of them.
const HALF = new Float32Array(65536);
for (let bits = 0; bits < 65536; ++bits) {
  const exponent = bits >> 10 & 31, fraction = bits & 1023;
  const magnitude = exponent === 0 ? fraction * 2 ** -24
    : exponent === 31 ? (fraction ? NaN : Infinity) : (1024 + fraction) * 2 ** (exponent - 25);
  HALF[bits] = bits & 32768 ? -magnitude : magnitude;
}
function floats(text) {
  const bytes = atob(text.trim());
  const values = new Float32Array(bytes.length / 2);
  for (let i = 0; i < values.length; ++i) {
    values[i] = HALF[bytes.charCodeAt(2 * i) | bytes.charCodeAt(2 * i + 1) << 8];
  }
  return values;
}

// Tone curves, linear to linear: the filmic one is Hable's, with white at 11.2.
const hable = x => (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3;
const CURVES = {
  srgb: x => x,
  reinhard: x => x / (1 + x),
  filmic: x => hable(2 * x) / hable(11.2),
};
const encode = x => x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;

// Rules of the style sheet that hold the pictures, by class.
const rules = new Map();
for (const rule of document.styleSheets[0].cssRules) {
  if (/^\.[pe]\d+-\d+$/.test(rule.selectorText || "")) rules.set(rule.selectorText.slice(1), rule);
}

for (const group of document.querySelectorAll(".pictures")) {
  const view = { zoom: 1, x: 0, y: 0 };
  const pictures = new Map();
  for (const script of group.querySelectorAll("script.halves")) {
    const values = floats(script.textContent);
    const width = Number(script.dataset.width);
    pictures.set(script.dataset.picture, { values, width, height: values.length / 3 / width });
  }

  // Keeps the picture over its pane and shows the view in every pane of the group.
  function apply() {
    const least = 1 - view.zoom;
    view.x = Math.min(0, Math.max(least, view.x));
    view.y = Math.min(0, Math.max(least, view.y));
    group.style.setProperty("--zoom", view.zoom);
    group.style.setProperty("--x", view.x);
    group.style.setProperty("--y", view.y);
    group.classList.toggle("zoomed", view.zoom > 1);
  }

  // Changes the zoom around a point given in shares of the pane.
  function zoomAt(factor, u, v) {
    const zoom = Math.min(LARGEST_ZOOM, Math.max(1, view.zoom * factor));
    view.x = u - (u - view.x) * zoom / view.zoom;
    view.y = v - (v - view.y) * zoom / view.zoom;
    view.zoom = zoom;
    apply();
  }

  function shares(pane, event) {
    const box = pane.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  for (const pane of group.querySelectorAll(".pane.linked")) {
    const pointers = new Map();
    pane.addEventListener("wheel", event => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      zoomAt(Math.exp(-0.004 * event.deltaY), ...shares(pane, event));
    }, { passive: false });
    pane.addEventListener("dblclick", event => zoomAt(2, ...shares(pane, event)));
    pane.addEventListener("pointerdown", event => {
      pointers.set(event.pointerId, shares(pane, event));
      if (view.zoom > 1 || pointers.size > 1) pane.setPointerCapture(event.pointerId);
    });
    pane.addEventListener("pointermove", event => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = shares(pane, event);
      if (pointers.size === 1 && view.zoom > 1) {
        view.x += now[0] - before[0];
        view.y += now[1] - before[1];
        apply();
      } else if (pointers.size === 2) {
        const box = pane.getBoundingClientRect();
        const [, other] = [...pointers].find(([id]) => id !== event.pointerId);
        const distance = point =>
          Math.hypot((point[0] - other[0]) * box.width, (point[1] - other[1]) * box.height);
        zoomAt(distance(now) / Math.max(1, distance(before)),
          0.5 * (now[0] + other[0]), 0.5 * (now[1] + other[1]));
      }
      pointers.set(event.pointerId, now);
    });
    for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
      pane.addEventListener(end, event => pointers.delete(event.pointerId));
    }
  }

  const viewer = group.querySelector(".viewer");
  if (!viewer) continue;
  const part = name => viewer.querySelector(name);

  // Draws every picture of the scene anew, with the exposure, curve and gamma that are set.
  const canvas = document.createElement("canvas");
  function nameStops() {
    const stops = Number(part(".exposure").value);
    const text = `${stops >= 0 ? "+" : "−"}${Math.abs(stops).toFixed(1)} stops`;
    part(".stops").textContent = text;
    part(".exposure").setAttribute("aria-valuetext", text);
  }
  function develop() {
    const stops = Number(part(".exposure").value), gamma = Number(part(".gamma").value);
    const curve = CURVES[part("select.curve").value], scale = 2 ** stops;
    for (const [name, { values, width, height }] of pictures) {
      Object.assign(canvas, { width, height });
      const context = canvas.getContext("2d");
      const image = context.createImageData(width, height);
      for (let i = 0, j = 0; i < values.length; ++i, ++j) {
        const x = Math.min(1, Math.max(0, curve(Math.max(0, values[i] * scale))));
        image.data[j] = Math.round(255 * encode(gamma === 1 ? x : x ** (1 / gamma)));
        if (i % 3 === 2) image.data[++j] = 255;
      }
      context.putImageData(image, 0, 0);
      const rule = rules.get(name);
      if (rule) rule.style.backgroundImage = `url(${canvas.toDataURL()})`;
    }
    nameStops();
  }
  let isDue = false;
  function developSoon() {
    if (isDue) return;
    isDue = true;
    setTimeout(() => { isDue = false; develop(); }, 16);
  }
  for (const name of [".exposure", ".gamma", "select.curve"]) {
    part(name).addEventListener("input", developSoon);
  }
  part(".neutral").addEventListener("click", () => {
    part(".exposure").value = group.dataset.exposure;
    part(".gamma").value = 1;
    part("select.curve").value = "srgb";
    developSoon();
  });
  nameStops();

  // Says what both pictures hold at a pixel, and marks it.
  const pixel = { x: 0, y: 0 };
  const digits = value => Number(value.toPrecision(4)).toString();
  function tell() {
    const first = pictures.values().next().value;
    if (!first) return;
    pixel.x = Math.min(first.width - 1, Math.max(0, pixel.x));
    pixel.y = Math.min(first.height - 1, Math.max(0, pixel.y));
    const at = side => {
      const option = part(`select.${side}`).selectedOptions[0];
      const picture = pictures.get(option.value.replace("e", "p"));
      if (!picture) return `${option.textContent}: no values`;
      const place = 3 * (pixel.y * picture.width + pixel.x);
      const [r, g, b] = picture.values.subarray(place, place + 3);
      return `${option.textContent.replace(": error", "")}: ${digits(r)} ${digits(g)} ${digits(b)}`;
    };
    part(".values").textContent = `${pixel.x},${pixel.y} · ${at("left")} · ${at("right")}`;
    const place = (index, count, offset) => 100 * ((index + 0.5) / count * view.zoom + offset);
    part(".cross").hidden = false;
    part(".cross").style.setProperty("--cx", `${place(pixel.x, first.width, view.x)}%`);
    part(".cross").style.setProperty("--cy", `${place(pixel.y, first.height, view.y)}%`);
  }
  for (const pane of group.querySelectorAll(".pane.linked")) {
    pane.addEventListener("pointermove", event => {
      const first = pictures.values().next().value;
      if (!first) return;
      const [u, v] = shares(pane, event);
      pixel.x = Math.floor((u - view.x) / view.zoom * first.width);
      pixel.y = Math.floor((v - view.y) / view.zoom * first.height);
      tell();
    });
  }

  // Puts the picture that a list names into its layer.
  function show(side) {
    const list = part(`select.${side}`);
    const option = list.selectedOptions[0];
    part(`.layer.${side} .picture`).className = `picture ${option.value}`;
    part(`.tag.${side}`).textContent = option.textContent;
  }
  for (const side of ["left", "right"]) {
    part(`select.${side}`).addEventListener("change", () => show(side));
    show(side);
  }

  const split = part(".split");
  const setSplit = () => viewer.style.setProperty("--split", `${split.value}%`);
  split.addEventListener("input", setSplit);
  setSplit();

  function flip() {
    const isFlipped = viewer.classList.toggle("flipped");
    const side = isFlipped ? "right" : "left";
    part(".tag.left").textContent = part(`select.${side}`).selectedOptions[0].textContent;
  }
  const flipMode = part("button.mode");
  flipMode.addEventListener("click", () => {
    const isFlip = viewer.classList.toggle("flip");
    viewer.classList.remove("flipped");
    flipMode.setAttribute("aria-pressed", isFlip);
    part("button.flip").hidden = !isFlip;
    show("left");
  });
  part("button.flip").addEventListener("click", flip);
  const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  part(".stage").addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const digit = /^Digit([1-9])$/.exec(event.code);
    const plain = [...part("select.left").options].filter(option => option.value.startsWith("p"));
    if (digit && plain[digit[1] - 1]) {
      const side = event.shiftKey ? "right" : "left";
      part(`select.${side}`).value = plain[digit[1] - 1].value;
      show(side);
      tell();
    } else if (event.key in ARROWS) {
      pixel.x += ARROWS[event.key][0];
      pixel.y += ARROWS[event.key][1];
      tell();
    } else if (event.key === "f" || event.key === "F") {
      if (!viewer.classList.contains("flip")) flipMode.click();
      flip();
    } else if (event.key === "+" || event.key === "-") {
      zoomAt(event.key === "+" ? 2 : 0.5, 0.5, 0.5);
      if (!part(".cross").hidden) tell();
    } else {
      return;
    }
    event.preventDefault();
  });
  part("button.in").addEventListener("click", () => zoomAt(2, 0.5, 0.5));
  part("button.out").addEventListener("click", () => zoomAt(0.5, 0.5, 0.5));
  part("button.reset").addEventListener("click", () => {
    Object.assign(view, { zoom: 1, x: 0, y: 0 });
    apply();
  });
}

// Sorts tables by a click on a head: first as numbers descending, then ascending, then as they were.
const numberOf = cell => {
  const text = cell.textContent.replaceAll("−", "-").replace(/^≤ /, "");
  const found = /^[+-]?\d+(\.\d+)?(e-?\d+)?/.exec(text);
  return found ? Number(found[0]) : NaN;
};
for (const table of document.querySelectorAll(".table table")) {
  const body = table.tBodies[0], original = [...body.rows];
  if (original.length < 2) continue;
  // A row heading that is left blank repeats the one above.
  let last = "";
  const names = new Map(original.map(row => [row, last = row.cells[0].textContent || last]));
  const blank = new Set(original.filter(row => !row.cells[0].textContent));
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const next = { descending: "ascending", ascending: "none" }[head.ariaSort] || "descending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      if (next !== "none") head.setAttribute("aria-sort", next);
      const isSorted = next !== "none";
      for (const row of blank) row.cells[0].textContent = isSorted ? names.get(row) : "";
      const sign = next === "descending" ? -1 : 1;
      const key = row => row.cells[column] ? numberOf(row.cells[column]) : NaN;
      const order = (a, b) => {
        const [x, y] = [key(a), key(b)];
        if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
        if (Number.isNaN(x)) {
          return sign * a.cells[column].textContent.localeCompare(b.cells[column].textContent);
        }
        return sign * (x - y);
      };
      body.append(...(isSorted ? [...original].sort(order) : original));
    });
  });
}
