// Rows of a table, kept by id: at 10 Hz most of it stands still. They are selected by a click or the arrow keys.

import { el } from "./dom.js";

/**
 * Rows for a table's body. `cells(item)` makes the cells after the first one, which is a button with the text
 * `name(id)`; `fill(cells, item)` writes them; `choose(id)` is told what the user selects, null for nothing.
 */
export function selectableRows(body, { name, cells, fill, choose }) {
  const rows = new Map(); // id -> row, in the order shown
  let selected = null;
  let shown = null; // what was brought into view last

  body.addEventListener("click", ({ target }) => pick(target.closest("tr")));
  body.addEventListener("keydown", walk);

  function make(item) {
    const button = el("button", { type: "button", tabIndex: -1 }, name(item.id));
    const values = cells(item);
    return el(
      "tr",
      { key: item.id, button, values },
      el("th", { scope: "row", class: "name" }, button),
      ...values,
    );
  }

  /** Shows these items in their order. */
  function update(items) {
    keepOnly(new Set(items.map(({ id }) => id)));
    items.forEach((item, position) => {
      const row = rows.get(item.id) ?? make(item);
      if (body.rows[position] !== row) body.insertBefore(row, body.rows[position] ?? null);
      fill(row.values, item);
    });
    rows.clear();
    for (const row of body.rows) rows.set(row.key, row);
    mark(selected);
  }

  function keepOnly(ids) {
    for (const [id, row] of rows) {
      if (ids.has(id)) continue;
      row.remove();
      rows.delete(id);
    }
  }

  /** Highlights a row, brings it into view when it is newly selected, and keeps one row in the tab order. */
  function mark(id) {
    selected = id;
    const tabStop = rows.has(id) ? id : rows.keys().next().value;
    for (const [key, row] of rows) {
      row.classList.toggle("selected", key === id);
      row.button.setAttribute("aria-pressed", String(key === id));
      row.button.tabIndex = key === tabStop ? 0 : -1;
    }
    if (id !== shown && rows.has(id)) rows.get(id).scrollIntoView({ block: "nearest", inline: "nearest" });
    if (id === null || rows.has(id)) shown = id;
  }

  /** Selects the row `by` further; the first or last one if none is selected. */
  function step(by) {
    const ids = [...rows.keys()];
    const at = ids.indexOf(selected);
    const next = at < 0 ? (by > 0 ? 0 : ids.length - 1) : within(ids, at + by);
    if (ids.length) choose(ids[next]);
  }

  function pick(row) {
    if (!row) return;
    row.button.focus({ preventScroll: true });
    choose(row.key === selected ? null : row.key);
  }

  function walk(event) {
    const by = { ArrowDown: 1, ArrowUp: -1, Home: -Infinity, End: Infinity }[event.key];
    if (!by) return;
    event.preventDefault();
    const all = [...body.rows];
    const next = all[within(all, all.indexOf(event.target.closest("tr")) + by)];
    next.button.focus();
    if (next.key !== selected) choose(next.key);
  }

  return { update, mark, step };
}

const within = (list, at) => Math.min(list.length - 1, Math.max(0, at));
