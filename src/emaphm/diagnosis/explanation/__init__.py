"""Whether an estimate explains a recording, and cautions that apply although it does."""
