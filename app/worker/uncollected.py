"""Importing this first makes the imports after it a fifth quicker: of what they make nearly all is kept, and so no
garbage is looked for until `app.worker.shared_memory` is imported."""

import gc

gc.disable()
