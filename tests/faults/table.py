"""The table of faults. A row more is a fault more: `README.md` beside this says how.

Which part of the lab a row belongs to stands in `part`, so that a red row finds its reader.
"""

from __future__ import annotations

from tests.faults import of_crowds, of_network, of_pages, of_processes, of_storage
from tests.faults.row import Fault

FAULTS: tuple[Fault, ...] = (
    *of_processes.ROWS,
    *of_storage.ROWS,
    *of_network.ROWS,
    *of_crowds.ROWS,
    *of_pages.ROWS,
)
