// A test in no folder.
