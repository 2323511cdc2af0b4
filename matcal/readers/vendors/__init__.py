"""One module a layout; the first reader of `READERS` that recognises a file reads it.

A new vendor is one module with a `Reader` and one line here, before `plain_table`, which takes whatever is left.
"""

from matcal.readers.vendors import autolab_nova, instron, labview, mts_793, mts_testsuite, plain_table

READERS = (mts_793.READER, mts_testsuite.READER, autolab_nova.IMPEDANCE, autolab_nova.READER, labview.READER,
           instron.READER, plain_table.READER)
