"""Judge a run from its records: one JSON, one page that needs nothing else, charts, and words.

It imports `base`, `geodesy` and `records`; `flight`, `noise`, `photogrammetry`, `batch`, `api` and
`cli` import it. Nothing here computes navigation: it counts, compares with what the filter
promised, and says in words what limits the flight.

The way of the data: `summary.run_summary` makes report.json from the records of a run
(`statistics.py`, `coverage.py`, `flightlines.py` count). `rules/` say what stands out, the most
important first. `charts/` are data that `assets/` (script and style, uPlot with its licence) draw
in the browser and matplotlib for papers; `figures/` has those of other verbs. `page.write_report`
joins them to report.html. A verb fills a `Document` once (`document.py`): headline, verdict and
sections of sentences and tables, rendered to the terminal and to its page.

Where to look
    what stands out: `rules/`; the list of the rules, their order and limit (rank 1):
        `rules/verdict.py`
    a chart of the report: what it shows `charts/run.py`, `support.py`, `gnss.py` there; as the text
        of the page `encoded.py` there; drawn by `assets/report.js`; its place in
        `_sections` of `page.py`
    how a chart becomes a picture: `charts/chart.py` (what a chart is); PNG, PDF, SVG by `drawn.py`
        and `artists.py`, `insgnss figures` by `files.py` there
    the table of images and its flags: `page.py`, shown by `Table` in `assets/report.js`
    the verdict, its colour and its reason: `verdict.py`; of a flight `rules/use.py`
    what no flight can show, listed once: `rules/hidden.py`
    what prints: sections that are `brief` and the map, all else is the appendix (`Document.html`,
        `@media print` of `assets/report.css`); `insgnss report`: `printed.py`
    satellites, ratio, age, PDOP of fixes: `fix_series` in `charts/gnss.py`; line by line
        `line_fixes` in `summary.py`
    the sentence on fixes minus solution: `residuals` of `rules/fixes.py`
    the wavelet (Allan) variance as a chart: `figures/noise.py`
    how a document becomes text or a page, folding, checks as a table: `document.py`; HTML
        `markup.py`; what stands in it is in the verb's own room, such as
        `insgnss/photogrammetry/block_adjustment/page.py`, `insgnss/flight/inspection/page.py`,
        `insgnss/noise/tuning/result.py`; that of a run: `page.py`, `sections.py`
"""
