// Zoom, values under the pointer and download. Without scripts nothing of it shows, and nothing is missing from the page.
(() => {
  const place = document.getElementById("live");
  const data = JSON.parse(document.getElementById("live-data").textContent);
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const pick = place.querySelector("select"), box = place.querySelector("div");
  let plot;
  const line = (label, name, width) => ({
    label, stroke: css(name), width, points: { show: false },
    value: (_, v) => (v == null ? "\u2013" : v.toPrecision(4)),
  });
  const axis = (label) => ({ label, stroke: css("--ink"), grid: { stroke: css("--grid") }, ticks: { stroke: css("--grid") } });
  const draw = () => {
    const channel = data.channels[pick.value];
    if (plot) plot.destroy();
    plot = new uPlot({
      width: box.clientWidth, height: 340,
      scales: { x: { time: false } },
      axes: [axis("Time, s"), { ...axis(channel.name + ", " + channel.unit), size: 80 }],
      series: [
        { label: "s", value: (_, v) => (v == null ? "\u2013" : v.toFixed(4)) },
        line("declared model", "--warm", 1.5), line("new model", "--cool", 1),
      ],
    }, [data.time, channel.before, channel.after], box);
  };
  const save = () => {
    const channel = data.channels[pick.value], { min, max } = plot.scales.x;
    const rows = data.time.flatMap((t, k) => (t < min || t > max ? [] : [[t, channel.before[k], channel.after[k]].join()]));
    const unit = channel.unit.replace(/\W+/g, "_");
    const text = ["time_s", "declared_" + unit, "new_" + unit].join() + "\n" + rows.join("\n") + "\n";
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    link.download = channel.name.replace(/\W+/g, "_") + ".csv";
    link.click();
    URL.revokeObjectURL(link.href);
  };
  data.channels.forEach((channel, k) => pick.add(new Option(channel.name, k)));
  pick.onchange = draw;
  place.querySelector("button").onclick = save;
  place.hidden = false;
  draw();
  addEventListener("resize", () => plot.setSize({ width: box.clientWidth, height: 340 }));
})();
