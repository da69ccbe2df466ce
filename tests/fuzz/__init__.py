"""Fuzzer with spoilt inputs: the command must do its work or refuse the input in one line."""
