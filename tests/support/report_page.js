// Uses the page of a study as a reader would, and leaves what it saw in the title.
const seen = {};
window.addEventListener("error", event => { seen.error = event.message; });
setTimeout(() => {
  try {
    const part = name => document.querySelector(`.viewer ${name}`);
    const background = name => getComputedStyle(document.querySelector(`.${name}`)).backgroundImage;
    const stage = part(".stage");
    const press = (key, more) =>
      stage.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, ...more }));
    const before = background("p0-0");
    part(".exposure").value = Number(part(".exposure").value) - 3;
    part(".exposure").dispatchEvent(new Event("input"));
    press("1", { code: "Digit1" });
    press("@", { code: "Digit2", shiftKey: true });
    seen.left = part(".tag.left").textContent;
    seen.right = part(".tag.right").textContent;
    const box = stage.getBoundingClientRect();
    stage.dispatchEvent(new PointerEvent("pointermove",
      { clientX: box.left + 0.51 * box.width, clientY: box.top + 0.51 * box.height, bubbles: true }));
    seen.values = part(".values").textContent;
    press("ArrowRight");
    seen.moved = part(".values").textContent;
    press("f");
    seen.flipped = part(".tag.left").textContent;
    const head = document.querySelector("thead tr").lastElementChild;
    const column = () =>
      [...head.closest("table").tBodies[0].rows].map(row => row.lastElementChild.textContent);
    const original = column();
    head.querySelector("button").click();
    seen.sorted = [head.ariaSort, column()];
    head.querySelector("button").click();
    head.querySelector("button").click();
    seen.restored = JSON.stringify(column()) === JSON.stringify(original);
    setTimeout(() => {
      seen.developed = background("p0-0") !== before && background("p0-0").startsWith('url("data:');
      seen.wide = document.documentElement.scrollWidth - window.innerWidth;
      document.title = JSON.stringify(seen);
    }, 300);
  } catch (error) {
    document.title = JSON.stringify({ error: String(error) });
  }
}, 100);
