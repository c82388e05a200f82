"""The manoeuvres of UN R157 as worlds."""
