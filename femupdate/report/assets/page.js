"use strict";
(function () {
  // Nothing on the page reaches out: Plotly would offer to send a chart to its makers.
  const REMOVED = ["lasso2d", "select2d", "sendDataToCloud", "sendChartToCloud"];
  const SETTINGS = { responsive: true, displaylogo: false, modeBarButtonsToRemove: REMOVED };

  const PAPER = 675; // px, the width of a sheet between its margins, A4 or Letter
  let printing = false;

  // Without its height a plot of a fixed width would have that of Plotly's own choice.
  function onPaper(plot) {
    return { autosize: false, width: PAPER, height: parseFloat(plot.style.height) };
  }

  function read(element) { return JSON.parse(element.textContent); }

  // A plot is drawn when it comes into view, so that the page opens at once.
  function draw(plot) {
    if (plot.dataset.state) return Promise.resolve();
    plot.dataset.state = "drawing";
    const figure = read(plot.nextElementSibling);
    const narrow = window.innerWidth < 640;
    const layout = Object.assign({}, figure.layout, printing ? onPaper(plot) : {});
    if (narrow) layout.margin = Object.assign({}, layout.margin, { l: 52, r: 8 });
    const settings = Object.assign({}, SETTINGS, { displayModeBar: narrow ? false : "hover" });
    return Plotly.newPlot(plot, figure.data, layout, settings).then(function () {
      plot.dataset.state = "drawn";
    });
  }

  const plots = Array.from(document.querySelectorAll(".plot"));
  const seen = new IntersectionObserver(function (entries) {
    entries.forEach(function (entry) {
      if (entry.isIntersecting) { seen.unobserve(entry.target); draw(entry.target); }
    });
  }, { rootMargin: "300px" });
  plots.forEach(function (plot) { seen.observe(plot); });

  // Tabs: a click or the arrow keys choose the panel.
  document.querySelectorAll(".tabs").forEach(function (list) {
    const tabs = Array.from(list.querySelectorAll("[role=tab]"));
    function choose(chosen) {
      tabs.forEach(function (tab) {
        const on = tab === chosen;
        tab.setAttribute("aria-selected", String(on));
        tab.tabIndex = on ? 0 : -1;
        const panel = document.getElementById(tab.getAttribute("aria-controls"));
        panel.hidden = !on;
        if (on) {
          const plot = panel.querySelector(".plot");
          draw(plot).then(function () { Plotly.Plots.resize(plot); });
        }
      });
    }
    tabs.forEach(function (tab, place) {
      tab.addEventListener("click", function () { choose(tab); });
      tab.addEventListener("keydown", function (event) {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!step) return;
        const next = tabs[(place + step + tabs.length) % tabs.length];
        next.focus();
        choose(next);
      });
    });
  });

  function quoted(value) {
    const raw = value === null || value === undefined ? "" : String(value);
    const text = raw.replace(/&lt;/g, "<").replace(/&gt;/g, ">").replace(/&amp;/g, "&");
    // A leading sign of a formula would be run by a spreadsheet.
    const safe = /^[=+@\t\r]|^-(?![\d.])/.test(text) ? "'" + text : text;
    return /[",\n]/.test(safe) ? '"' + safe.replace(/"/g, '""') + '"' : safe;
  }

  function axisName(axis, otherwise) {
    const title = axis && axis.title && axis.title.text;
    return title ? title : otherwise;
  }

  // The names of the rows of an axis that counts them; intervals of one row lie beside its middle.
  function named(axis) { return axis && axis.type !== "log" ? axis.ticktext : undefined; }

  // Every series of every panel in one tidy table.
  function chartRows(figure) {
    const rows = [];
    figure.querySelectorAll(".plot").forEach(function (plot) {
      const content = read(plot.nextElementSibling);
      const layout = content.layout;
      const panel = plot.dataset.panel;
      content.data.forEach(function (series) {
        const suffix = (series.xaxis || "x").slice(1);
        const x = axisName(layout["xaxis" + suffix], "x"), y = axisName(layout["yaxis" + (series.yaxis || "y").slice(1)], "y");
        if (series.type === "heatmap") {
          series.z.forEach(function (row, j) {
            row.forEach(function (value, i) { rows.push([panel, series.name || "value", x, y, series.x[i], series.y[j], value, "", ""]); });
          });
        } else if (series.x && series.y) {
          const bar = series.error_y && series.error_y.array ? series.error_y : series.error_x || {};
          const rowNames = named(layout["yaxis" + (series.yaxis || "y").slice(1)]);
          series.x.forEach(function (value, i) {
            const up = bar.array ? bar.array[i] : "", down = bar.arrayminus ? bar.arrayminus[i] : up;
            const row = rowNames ? rowNames[Math.round(series.y[i])] : series.y[i];
            rows.push([panel, series.name || "", x, y, value, row, "", up, down]);
          });
        }
      });
    });
    return [["panel", "series", "x_is", "y_is", "x", "y", "value", "error_up", "error_down"]].concat(rows);
  }

  function tableRows(figure) {
    return Array.from(figure.querySelectorAll("tr")).map(function (row) {
      return Array.from(row.children).map(function (cell) { return cell.textContent; });
    });
  }

  document.querySelectorAll(".csv").forEach(function (button) {
    button.addEventListener("click", function () {
      const figure = document.getElementById(button.dataset.csv);
      const rows = figure.classList.contains("chart") ? chartRows(figure) : tableRows(figure);
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
  function drawAll() { return Promise.all(plots.map(draw)); }
  document.querySelectorAll("[data-tool]").forEach(function (button) {
    button.addEventListener("click", function () {
      if (button.dataset.tool === "print") { openAll(true); drawAll().then(function () { window.print(); }); }
      else openAll(button.dataset.tool === "open");
    });
  });
  // The browser does not wait: what is drawn by now gets the width, the rest is drawn with it.
  window.addEventListener("beforeprint", function () {
    openAll(true);
    printing = true;
    plots.forEach(function (plot) { if (plot.dataset.state) Plotly.relayout(plot, onPaper(plot)); });
    drawAll();
  });
  window.addEventListener("afterprint", function () {
    printing = false;
    plots.forEach(function (plot) {
      Plotly.purge(plot);
      delete plot.dataset.state;
      seen.observe(plot);
    });
  });
  sections.forEach(function (section) {
    section.addEventListener("toggle", function () {
      if (section.open) section.querySelectorAll(".plot").forEach(function (plot) {
        if (plot.dataset.state === "drawn" && plot.offsetParent) Plotly.Plots.resize(plot);
      });
    });
  });
  document.querySelectorAll("nav a").forEach(function (link) {
    link.addEventListener("click", function () {
      document.querySelector(link.getAttribute("href")).open = true;
    });
  });
  window.femupdatePage = { drawAll: drawAll };
})();
