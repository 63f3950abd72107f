// The list of edits: what is on, in which order; every button is a real one.
function show() {
  const list = element.querySelector("ol");
  const focused = element.contains(document.activeElement) ? document.activeElement.dataset.key : null;
  const steps = props.value || [];
  list.replaceChildren(...steps.map((step, k) => row(step, k, steps.length)));
  element.querySelector(".none").hidden = steps.length > 0;
  if (focused) { const again = list.querySelector(`[data-key="${focused}"]`); if (again) again.focus(); }
}
function row(step, k, count) {
  const item = document.createElement("li");
  if (step.current) item.classList.add("current");
  if (!step.on) item.classList.add("off");
  const box = document.createElement("input");
  box.type = "checkbox"; box.checked = step.on; box.dataset.key = `toggle-${k}`;
  box.setAttribute("aria-label", `Edit ${k + 1} on`);
  box.addEventListener("change", () => trigger("act", { what: "toggle", index: k }));
  const text = button(step.text, "choose", k, "Change this edit"); text.classList.add("text");
  if (step.current) text.setAttribute("aria-current", "true");
  const up = button("↑", "up", k, "Move up"), down = button("↓", "down", k, "Move down");
  up.disabled = k === 0; down.disabled = k === count - 1;
  item.append(box, text, up, down, button("✕", "remove", k, "Remove"));
  return item;
}
function button(text, what, k, label) {
  const b = document.createElement("button");
  b.type = "button"; b.textContent = text; b.title = label; b.dataset.key = `${what}-${k}`;
  if (what !== "choose") b.setAttribute("aria-label", `${label}: edit ${k + 1}`);
  b.addEventListener("click", () => trigger("act", { what: what, index: k }));
  return b;
}
show();
watch("value", show);
