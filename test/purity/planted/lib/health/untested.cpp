// A library without a test.
