"""What pyproject.toml cannot say: `configs/` is shipped as the package `robotfleet_configs`.

At the root of the source tree it has the name that people expect; in site-packages it needs one
that nobody else has.
"""

from setuptools import find_namespace_packages, setup

CODE = ("keyexpr_schema", "fleet", "workers", "sim", "cli")
CONFIGS = "robotfleet_configs"

setup(
    packages=[
        *find_namespace_packages(include=[*CODE, *(f"{name}.*" for name in CODE)]),
        CONFIGS,
        *(f"{CONFIGS}.{folder}" for folder in find_namespace_packages("configs")),
    ],
    package_dir={CONFIGS: "configs"},
)
