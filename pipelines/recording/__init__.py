"""Getting recordings and looking after them: import, check, record, recover, replay, the virtual laboratory."""
