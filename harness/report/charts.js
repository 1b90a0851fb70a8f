// Fills the places of the charts of a page, whose data stand in it in gzip and base64: unpacked they are four times as long.
"use strict";
(async () => {
  for (const place of document.querySelectorAll("script.packed")) {
    const packed = Uint8Array.from(atob(place.textContent), letter => letter.charCodeAt(0));
    const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const { documents, items } = await new Response(unpacked).json();
    await Bokeh.embed.embed_items(documents, items);
  }
})().catch(() => document.querySelectorAll("[data-root-id]").forEach(place => place.textContent = "This chart needs a newer browser."));
// Plots take their colours when they are drawn, so a change of scheme needs a new drawing.
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => location.reload());
