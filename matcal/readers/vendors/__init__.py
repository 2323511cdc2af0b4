"""One module a machine: MTS, Instron, Autolab, plain tables and workbooks."""
