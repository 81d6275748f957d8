# SPDX-License-Identifier: MIT
"""A headless browser (Debian's chromium) for tests of pages, with what they did on the network and wrote to the
console."""
import json
import time
from contextlib import contextmanager

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-extensions",
         "--no-first-run", "--disable-background-networking", "--window-size=1280,1000")


@contextmanager
def browser(profile):
    """A session with a profile folder of its own."""
    options = webdriver.ChromeOptions()
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.binary_location = "/usr/bin/chromium"
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    try:
        yield driver
    finally:
        driver.quit()


def until(condition, seconds=60):
    """The first true value of condition(); fails after some seconds of a busy machine."""
    end = time.monotonic() + seconds
    while True:
        value = condition()
        if value:
            return value
        assert time.monotonic() < end, "the page did not get there"
        time.sleep(0.03)


def opened(driver, path):
    """Open a page from a file; the addresses that it asked for, but for those of the browser's own pages."""
    driver.get_log("performance")
    driver.get_log("browser")
    driver.get(path.resolve().as_uri())
    until(lambda: driver.execute_script("return document.readyState === 'complete'"))
    messages = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    urls = [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    return [url for url in urls if not url.startswith(("chrome://", "chrome-untrusted://"))]


def complaints(driver):
    """What stands in the console: errors, and what the content security policy refused. Not that a test reads
    pixels."""
    return [entry["message"] for entry in driver.get_log("browser") if "willReadFrequently" not in entry["message"]]
