// The theme makes the bar with the button that copies a block after the page is shown; each needs a name of its own. It also takes blocks
// that scroll away from the keyboard where a device has no pointer.
new MutationObserver(() => {
  document.querySelectorAll(".md-code__nav").forEach((nav, number) => {
    if (!nav.hasAttribute("aria-label")) nav.setAttribute("aria-label", `Code block ${number + 1}`)
  })
  document.querySelectorAll("pre > code:not([tabindex]), .md-typeset__scrollwrap:not([tabindex])").forEach(code => code.setAttribute("tabindex", "0"))
}).observe(document.body, {attributeFilter: ["tabindex"], attributes: true, childList: true, subtree: true})
