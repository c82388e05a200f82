"""What you choose: settings by dotted names, planners and predictors by name, and the planner of each agent."""
