"""The roof: files, tools, reports and the window over what the other rooms do."""
