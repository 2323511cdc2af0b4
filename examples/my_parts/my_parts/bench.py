from matcal.readers.cells import text_grid
from matcal.readers.columns import Header, read_columns
from matcal.readers.reader import Reader


def read_bench(source, selection=None):
    grid = text_grid(source.text, source.path, "|")
    names = [(cell.split("_")[0], cell.split("_")[1]) for cell in grid.rows[1]]
    return read_columns(grid, Header(names, grid.lines[1], range(2, len(grid.rows))), "bench", selection)


BENCH = Reader("bench", "our bench", lambda source: source.text.startswith("BENCH"), read_bench)
