// A process without a test.
