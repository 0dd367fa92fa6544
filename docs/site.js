// Wide tables scroll by keyboard, and a number tells the menus of blocks of code apart.
const mend = () => {
  document.querySelectorAll(".md-typeset__scrollwrap").forEach((table) => (table.tabIndex = 0));
  document
    .querySelectorAll(".md-code__nav")
    .forEach((menu, k) => menu.setAttribute("aria-label", `Code ${k + 1}`));
};
mend();
new MutationObserver(mend).observe(document.body, { childList: true, subtree: true });
