"""What the pages show: charts as data, drawn by the browser or, for papers, by matplotlib."""
