"""Response models: what a spring does at a temperature."""
