() => {
  document.documentElement.lang = "en";
  // Of an event that skips the queue Gradio shows no error.
  const note = document.createElement("div");
  note.id = "message";
  note.setAttribute("role", "alert");
  note.hidden = true;
  note.onclick = () => { note.hidden = true; };
  document.body.append(note);
  // Gradio's label of a text box with a copy button names the button alone.
  new MutationObserver(() => {
    for (const box of document.querySelectorAll(".block textarea:not([aria-label])")) {
      const name = box.closest(".block").querySelector("[data-testid=block-info]");
      if (name) box.setAttribute("aria-label", name.textContent.trim());
    }
  }).observe(document.body, { childList: true, subtree: true });
  // The photo is seen as long as a key or the button is held.
  const hold = (on) => document.querySelector("#stage .view")?.classList.toggle("held", on);
  document.addEventListener("pointerdown", (e) => { if (e.target.id === "before") hold(true); });
  for (const over of ["keyup", "pointerup", "pointercancel", "blur"]) window.addEventListener(over, () => hold(false));
  document.addEventListener("keydown", (e) => {
    const key = e.key.toLowerCase(), typing = e.target.matches("textarea, input:not([type=range], [type=checkbox], [type=radio])");
    if (typing || e.altKey) return;
    if (key === "b" || (e.target.id === "before" && (key === " " || key === "enter"))) hold(true);
    if (!(e.ctrlKey || e.metaKey)) return document.querySelectorAll("#tools fieldset:first-child input")[key - 1]?.click();
    if (key !== "z" && key !== "y") return;
    e.preventDefault();
    document.getElementById(key === "y" || e.shiftKey ? "redo" : "undo").click();
  });
  let timer;
  const say = (text) => {
    // The server has made markup of a message harmless; here it is text again.
    note.textContent = text.replaceAll("&lt;", "<").replaceAll("&gt;", ">").replaceAll("&amp;", "&");
    note.hidden = false;
    clearTimeout(timer);
    timer = setTimeout(() => { note.hidden = true; }, 12000);
  };
  const ask = window.fetch.bind(window);
  window.fetch = async (...request) => {
    const answer = await ask(...request);
    if (!answer.ok && answer.url.includes("/run/predict"))
      answer.clone().json().then((body) => { if (typeof body.error === "string") say(body.error); }).catch(() => {});
    return answer;
  };
}
