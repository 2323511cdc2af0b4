"""One module a layout; the first reader of `readers` that recognises a file reads it.

A new vendor is one module with a `Reader` and one line here, or an entry point `touchcal.readers` of an installed
package; `plain_table` comes last, as it takes whatever is left.
"""

from matcal.readers.reader import Reader
from matcal.readers.vendors import autolab_nova, instron, labview, mts_793, mts_testsuite, plain_table
from touchcal.entry_points import added

_READERS = (mts_793.READER, mts_testsuite.READER, autolab_nova.IMPEDANCE, autolab_nova.READER, labview.READER,
            instron.READER)


def readers() -> tuple[Reader, ...]:
    """All readers, in the order in which they are asked."""
    return (*_READERS, *added("readers").values(), plain_table.READER)
