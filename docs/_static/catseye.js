// Names for a screen reader that the theme leaves out.
document.addEventListener("DOMContentLoaded", () => {
  for (const toggle of document.querySelectorAll(".toctree-toggle")) {
    const link = toggle.closest("li")?.querySelector("a");
    toggle.closest("summary")?.setAttribute("aria-label", `Pages of ${link?.textContent.trim() ?? "this part"}`);
  }
  // The words that a button shows are its name.
  for (const shown of document.querySelectorAll("details.hide summary")) shown.removeAttribute("aria-label");
  // A long formula, and a cell's figure on a phone, scrolls by itself: the keyboard must reach it.
  for (const part of document.querySelectorAll("div.math, .cell_output figure")) part.setAttribute("tabindex", "0");
  // A signature on several lines is a list without terms.
  for (const part of document.querySelectorAll("dt.sig dl, dt.sig dd")) part.setAttribute("role", "presentation");
});
