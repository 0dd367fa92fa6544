// A screen reader tells the menus of blocks of code apart by their numbers.
const number = () =>
  document
    .querySelectorAll(".md-code__nav")
    .forEach((menu, k) => menu.setAttribute("aria-label", `Code ${k + 1}`));
new MutationObserver(number).observe(document.body, { childList: true, subtree: true });
