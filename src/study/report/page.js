"use strict";
// Viewer: one zoom and pan for all pictures of a scene, two of them overlaid.
document.body.classList.remove("without-script");

const LARGEST_ZOOM = 32;

for (const group of document.querySelectorAll(".pictures")) {
  const view = { zoom: 1, x: 0, y: 0 };

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
  part("button.in").addEventListener("click", () => zoomAt(2, 0.5, 0.5));
  part("button.out").addEventListener("click", () => zoomAt(0.5, 0.5, 0.5));
  part("button.reset").addEventListener("click", () => {
    Object.assign(view, { zoom: 1, x: 0, y: 0 });
    apply();
  });
}
