"""The judgement on data and answer: verdicts, culprits, which model predicts, what can not be told apart."""
