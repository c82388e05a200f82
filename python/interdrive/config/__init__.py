"""What you choose: settings by dotted names, planners and predictors by name, and who plans for which agent."""
