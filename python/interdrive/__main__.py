"""`python -m interdrive` is the same as `interdrive`."""

from interdrive.cli import main

if __name__ == "__main__":
    main(prog_name="interdrive")
