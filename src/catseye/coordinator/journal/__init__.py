"""What is kept of a night, durable before it is acknowledged, and its replay."""
