"""What each ZY command does: functions of a ranger's state and the values of its request."""
