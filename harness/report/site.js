// The matrix of verdicts: filter, comparison of two columns, arrow keys, and a fragment of the address that brings all of it back.
// The page says everything without this file; what it adds is hidden until it runs.
"use strict";
(() => {
  const table = document.querySelector("table.verdicts");
  const form = document.getElementById("filter");
  if (!table || !form) return;
  const shown = document.getElementById("shown");
  const permalink = document.getElementById("permalink");
  const compared = document.getElementById("compared");
  const names = ["name", "verdict", "kind", "feature", "a", "b"];
  // Beyond this factor two errors of one row are said to differ.
  const APART = 10;
  const rows = [...table.tBodies[0].rows].map(line => ({
    line,
    about: line.cells[0].dataset,
    cells: [...line.cells].slice(1),
    of(column) { return this.cells.find(cell => cell.dataset.column === column); },
  }));
  let focused = "";

  const isRed = cell => cell.dataset.agrees === "no";
  const matches = {
    "": () => true,
    red: row => row.cells.some(isRed),
    surprise: row => row.cells.some(cell => cell.dataset.expected === "no"),
  };

  function keeps(row) {
    const { name, verdict, kind, feature } = form.elements;
    const asked = verdict.value;
    const hasVerdict = matches[asked] || (found => found.cells.some(cell => "=" + cell.dataset.verdict === asked));
    return row.about.row.toLowerCase().includes(name.value.trim().toLowerCase())
      && (!kind.value || row.about.kind === kind.value)
      && (!feature.value || row.about.features.split(", ").includes(feature.value))
      && hasVerdict(row);
  }

  const number = text => text === undefined ? null : text === "inf" ? Infinity : Number(text);

  // What differs between two cells of a row, in words; "" for nothing.
  function difference(one, other) {
    if (one.dataset.verdict !== other.dataset.verdict) return "verdict";
    const [low, high] = [number(one.dataset.error), number(other.dataset.error)].sort((x, y) => x - y);
    if (low === null || high === null || low === high) return "";
    return high > APART * low ? "error" : "";
  }

  function element(tag, text, attributes = {}) {
    const made = Object.assign(document.createElement(tag), { textContent: text });
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    return made;
  }

  function copied(cell, scope) {
    const made = document.createElement(scope ? "th" : "td");
    if (scope) made.setAttribute("scope", scope);
    made.className = cell.className;
    made.append(...[...cell.cloneNode(true).childNodes]);
    return made;
  }

  function compare() {
    const [a, b] = [form.elements.a.value, form.elements.b.value];
    compared.replaceChildren();
    for (const cell of table.querySelectorAll(".chosen")) cell.classList.remove("chosen");
    if (!a || !b || a === b) return;
    const visible = rows.filter(row => !row.line.hidden);
    const both = visible.filter(row => row.of(a).dataset.agrees && row.of(b).dataset.agrees);
    const differing = both.filter(row => difference(row.of(a), row.of(b)));
    for (const row of rows) [row.of(a), row.of(b)].forEach(cell => cell.classList.add("chosen"));
    compared.append(element("h3", `${a} and ${b}`));
    const told = `${differing.length} of ${both.length} rows that were asked of both differ: in verdict, or in error by more than ${APART} times.`;
    compared.append(element("p", told));
    if (!differing.length) return;
    const box = element("div", "", { class: "wide", role: "group", tabindex: "0", "aria-label": `What differs between ${a} and ${b}` });
    const made = element("table", "", { class: "matrix" });
    made.append(element("caption", `What differs between ${a} and ${b}`));
    const head = made.createTHead().insertRow();
    for (const title of ["mechanism or robot", a, b, "differs in"]) head.append(element("th", title, { scope: "col" }));
    const body = made.createTBody();
    for (const row of differing) {
      const line = body.insertRow();
      line.append(copied(row.line.cells[0], "row"), copied(row.of(a)), copied(row.of(b)));
      line.append(element("td", "", {}));
      line.lastChild.append(element("span", difference(row.of(a), row.of(b))));
    }
    box.append(made);
    compared.append(box);
  }

  function address() {
    const asked = new URLSearchParams();
    for (const name of names) if (form.elements[name].value) asked.set(name, form.elements[name].value);
    if (focused) asked.set("cell", focused);
    return asked.size ? `#?${asked}` : "#verdicts";
  }

  function remember() {
    permalink.setAttribute("href", address());
    if (location.hash !== address() && (location.hash.startsWith("#?") || address() !== "#verdicts")) {
      history.replaceState(null, "", address());
    }
  }

  function show() {
    for (const row of rows) row.line.hidden = !keeps(row);
    shown.textContent = `${rows.filter(row => !row.line.hidden).length} of ${rows.length} rows.`;
    compare();
    remember();
  }

  // The state of the page as the address has it; what no field knows is left out.
  function restore() {
    if (!location.hash.startsWith("#?")) return;
    const asked = new URLSearchParams(location.hash.slice(2));
    for (const name of names) {
      const field = form.elements[name];
      const value = asked.get(name) || "";
      field.value = value;
      if (field.value !== value) field.value = "";
    }
    focused = asked.get("cell") || "";
    const cell = focused && document.getElementById(focused);
    if (!cell || !table.contains(cell)) focused = "";
    show();
    if (focused) {
      const place = cell.querySelector("a") || cell;
      place.focus({ preventScroll: true });
      cell.scrollIntoView({ block: "center", inline: "center" });
    }
  }

  // Every cell can be reached by arrow keys, also one without a link; Tab goes on from link to link.
  for (const row of rows) for (const cell of row.cells) {
    if (!cell.querySelector("a")) cell.firstElementChild.tabIndex = -1;
  }

  const STEPS = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };

  table.addEventListener("keydown", event => {
    const step = STEPS[event.key];
    const cell = event.target.closest("td, tbody th");
    if (!step || !cell) return;
    const lines = rows.map(row => row.line).filter(line => !line.hidden);
    const line = lines[lines.indexOf(cell.parentElement) + step[0]];
    const next = line && line.cells[cell.cellIndex + step[1]];
    if (!next) return;
    event.preventDefault();
    (next.querySelector("a") || next.firstElementChild).focus();
  });

  table.addEventListener("focusin", event => {
    const cell = event.target.closest("td");
    focused = cell ? cell.id : "";
    remember();
  });

  form.addEventListener("input", show);
  form.addEventListener("submit", event => event.preventDefault());
  form.addEventListener("reset", () => { focused = ""; setTimeout(show); });
  addEventListener("hashchange", restore);
  form.hidden = false;
  if (location.hash.startsWith("#?")) restore(); else show();
})();
