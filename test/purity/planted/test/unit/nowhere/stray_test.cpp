// No lib/nowhere is there to test.
