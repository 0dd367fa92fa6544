"use strict";
(function () {
  function quoted(value) {
    const text = String(value);
    // A leading sign of a formula would be run by a spreadsheet.
    const safe = /^[=+@\t\r]|^-(?![\d.])/.test(text) ? "'" + text : text;
    return /[",\n]/.test(safe) ? '"' + safe.replace(/"/g, '""') + '"' : safe;
  }

  function tableRows(figure) {
    return Array.from(figure.querySelectorAll("tr")).map(function (row) {
      return Array.from(row.children).map(function (cell) { return cell.textContent; });
    });
  }

  document.querySelectorAll(".csv").forEach(function (button) {
    button.addEventListener("click", function () {
      const figure = document.getElementById(button.dataset.csv);
      const rows = tableRows(figure);
      const text = rows.map(function (row) { return row.map(quoted).join(","); }).join("\r\n") + "\r\n";
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob(["\ufeff" + text], { type: "text/csv" }));
      link.download = button.dataset.name + ".csv";
      link.click();
      setTimeout(function () { URL.revokeObjectURL(link.href); }, 1000);
    });
  });

  const sections = Array.from(document.querySelectorAll("details.section"));
  function openAll(open) { sections.forEach(function (section) { section.open = open; }); }
  document.querySelectorAll("[data-tool]").forEach(function (button) {
    button.addEventListener("click", function () {
      openAll(button.dataset.tool !== "close");
      if (button.dataset.tool === "print") window.print();
    });
  });
  window.addEventListener("beforeprint", function () { openAll(true); });
  document.querySelectorAll("nav a").forEach(function (link) {
    link.addEventListener("click", function () {
      document.querySelector(link.getAttribute("href")).open = true;
    });
  });
})();
