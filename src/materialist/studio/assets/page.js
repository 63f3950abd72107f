() => { document.body.classList.remove("dark"); document.documentElement.lang = "en"; }
